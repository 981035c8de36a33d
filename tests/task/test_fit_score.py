"""The score's weights: made, hidden in labels, and found again; judged on scenes that they were not fitted to."""

import tomllib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.cell.scene_files import save_scene
from handey_studio.cell.scenes import SceneOptions, TruePose, random_scene
from handey_studio.cli import main
from handey_studio.geometry.transforms import from_xyz_rpy, transform
from handey_studio.localization import score
from handey_studio.localization.score import FEATURES, FITTED, ScoreWeights, weights_from
from handey_studio.task.bench_locate.fit_score import calibration, fit, held_out_odds, toml
from handey_studio.task.bench_locate.weighed import Weighed, is_right
from handey_studio.world import Library
from handey_studio.world.library import bundled

K = 3
HERE = from_xyz_rpy((0.05, 0.02, 0.03), (0.3, -0.2, 1.0))


def candidates(seed, worth, intercept, n=4000):
    """Features of unlike sizes, and labels drawn with the probabilities that the weights tell."""
    rng = np.random.default_rng(seed)
    features = rng.normal((0.0, 2.0, -1.0), (1.0, 0.1, 5.0), (n, K))
    right = rng.random(n) < 1.0 / (1.0 + np.exp(-(intercept + features @ worth)))
    return features, right


def newton(features, right):
    """Naive oracle: Newton's steps on the log likelihood, without ridge."""
    X, w = np.column_stack([features, np.ones(len(features))]), np.zeros(K + 1)
    for _ in range(50):
        p = 1.0 / (1.0 + np.exp(-X @ w))
        w += np.linalg.solve((X * (p * (1 - p))[:, None]).T @ X, X.T @ (right - p))
    return w


@given(st.integers(0, 1000), st.lists(st.floats(-2.0, 2.0), min_size=K, max_size=K))
@settings(max_examples=20, deadline=None)
def test_hidden_weights_are_found(seed, units):
    worth = np.array(units) / (1.0, 0.1, 5.0)
    features, right = candidates(seed, worth, -2.0 * worth[1])
    found, oracle = fit(features, right, ridge=0.0), newton(features, right)
    assert np.allclose(found.worth, oracle[:-1], rtol=1e-2, atol=1e-2) and np.isclose(found.intercept, oracle[-1], rtol=1e-2, atol=2e-2)
    assert np.abs((found.worth - worth) * (1.0, 0.1, 5.0)).max() < 0.4, "as far as 4000 labels tell"
    assert np.allclose(found.typical, np.median(features[right], axis=0))


def test_what_can_be_told_apart_for_sure_keeps_finite_weights():
    features = np.linspace(-1, 1, 50)[:, None]
    found = fit(features, features[:, 0] > 0)
    assert np.isfinite(found.worth).all() and found.worth[0] > 5
    constant = fit(np.column_stack([features, np.ones(50)]), features[:, 0] > 0)
    assert np.isfinite(constant.worth).all() and np.isfinite(constant.intercept)


@pytest.mark.parametrize(("right", "kind"), [(np.ones(5, bool), "right"), (np.zeros(5, bool), "wrong"), (np.zeros(0, bool), "wrong")])
def test_candidates_of_one_kind_are_refused(right, kind):
    with pytest.raises(BadInput, match=f"all {len(right)} candidates are {kind}"):
        fit(np.zeros((len(right), K)), right)


def test_a_scene_is_judged_without_its_own_labels():
    features, right = candidates(3, np.array([1.0, 0.0, 0.2]), 0.0, 600)
    scene = np.arange(600) % 10
    lied = np.where(scene % 5 == 2, ~right, right)
    honest, other = held_out_odds(Weighed(features, right, scene)), held_out_odds(Weighed(features, lied, scene))
    assert np.allclose(honest[scene % 5 == 2], other[scene % 5 == 2])
    assert not np.allclose(honest[scene % 5 == 1], other[scene % 5 == 1])


def test_the_table_of_probabilities_counts():
    p, right = np.array([0.05, 0.05, 0.35, 0.38, 0.95, 0.95, 1.0 - 1e-9]), np.array([0, 0, 0, 1, 1, 0, 1], bool)
    told = calibration(np.log(p / (1 - p)), right)
    assert [(of["from"], of["count"], round(of["right"], 3)) for of in told["bins"]] == [(0.0, 2, 0.0), (0.3, 2, 0.5), (0.9, 3, 0.667)]
    assert told["bins"][1]["probability"] == pytest.approx(0.365)
    assert told["log_loss"] == pytest.approx(-np.log(np.where(right, p, 1 - p)).mean())
    assert told["log_loss_of_base_rate"] == pytest.approx(-np.log(np.where(right, 3 / 7, 4 / 7)).mean())
    assert {kept["from"]: (round(kept["right"], 3), kept["wrong"]) for kept in told["kept"]}[0.5] == (0.667, 1)


def test_labels_tell_right_wrong_and_what_teaches_nothing():
    part = Library(bundled()).part("l_block")
    truth = [TruePose("l_block", HERE, 0.9, 900)]
    middle = part.solid.volume_and_centroid[1]
    turn = np.eye(4)
    turn[:3, :3] = np.diag([-1.0, -1.0, 1.0])
    turn[:3, 3] = middle - turn[:3, :3] @ middle  # half a turn about its own middle
    assert is_right(HERE @ from_xyz_rpy((0.003, 0.0, 0.0), (0.02, 0.0, 0.0)), part, truth) is True
    assert is_right(HERE @ transform(None, (0.009, 0.0, 0.0)), part, truth) is None, "nearly"
    assert is_right(HERE @ turn, part, truth) is False, "a look-alike in the same place"
    assert is_right(HERE @ transform(None, (0.3, 0.0, 0.0)), part, truth) is False
    assert is_right(HERE, part, []) is False, "an absent part"


def test_the_file_of_weights_is_read_as_it_was_written():
    weights = ScoreWeights(1.25, np.arange(len(FEATURES)) - 3.5, np.linspace(0, 1, len(FEATURES)))
    read = weights_from(tomllib.loads(toml(weights)))
    assert read.intercept == 1.25 and np.allclose(read.worth, weights.worth) and np.allclose(read.typical, weights.typical, rtol=1e-3)


def test_the_shipped_weights_are_those_of_the_features():
    with open(score.__file__.replace("score.py", "score.toml"), "rb") as file:
        table = tomllib.load(file)
    assert tuple(table["weights"]) == tuple(table["typical"]) == FEATURES
    assert np.isfinite(FITTED.worth).all() and np.all(FITTED.worth != 0)


def test_weights_are_fitted_from_the_shell(tmp_path, capsys):
    """A small pile and an open scene, already made."""
    library = Library(bundled())
    for seed in (4, 5):
        save_scene(random_scene(seed, library, SceneOptions(bodies=4, clutter=(0, 0.3), spread=(0.08, 0.12))), tmp_path / f"{seed:04d}")
    out = tmp_path / "score.toml"
    assert main(["fit", "score", "--seeds", "4:6", "--scenes", str(tmp_path), "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "candidates in 2 scenes" in told and "on scenes it has not seen" in told
    read = weights_from(tomllib.loads(out.read_text()))
    assert np.isfinite(read.worth).all() and (read.worth != 0).any()
    assert main(["fit", "score", "--out", str(tmp_path / "score.json")]) == 2 and ".toml" in capsys.readouterr().err
