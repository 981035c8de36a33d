"""The score's weights: made, hidden in labels, and found again; judged on scenes that they were not fitted to."""

import tomllib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.cell.scenes.pile_scenes import SceneOptions, TruePose, random_scene
from handey_studio.cell.scenes.scene_files import save_scene
from handey_studio.cli import main
from handey_studio.geometry.transforms import from_xyz_rpy, transform
from handey_studio.localization.fitted import TABLE
from handey_studio.localization.joint import MAX_CLAIMED, SAME_READINGS, WITHIN, Rivalry, probabilities
from handey_studio.localization.promise import FEATURES as PROMISES
from handey_studio.localization.promise import PromiseWeights, promise_weights
from handey_studio.localization.score import FEATURES, FITTED, ScoreWeights, weights_from
from handey_studio.task.bench.locate.fit_score import FittedWeights, calibration, held_out, toml
from handey_studio.task.bench.locate.logit import conditional, fit, fit_order
from handey_studio.task.bench.locate.truth_judge import pose_error
from handey_studio.task.bench.locate.weighed import Lineup, Weighed, instances_of, is_right
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


def groups_of_rivals(seed, worth, intercept, groups=1500, size=4):
    """Features of groups, in each of which one at most is right, drawn with the odds that the weights tell; the pairs of rivals."""
    rng = np.random.default_rng(seed)
    features = rng.normal((0.0, 2.0, -1.0), (1.0, 0.1, 5.0), (groups, size, K))
    shares = np.exp(np.concatenate([np.zeros((groups, 1)), intercept + features @ worth], axis=1))
    chance = np.cumsum(shares / shares.sum(axis=1, keepdims=True), axis=1)
    drawn = (rng.random((groups, 1)) > chance).sum(axis=1) - 1  # −1: none of them
    right = np.arange(size) == drawn[:, None]
    pairs = np.array([(i, j) for j in range(size) for i in range(j)])
    rivals = (np.arange(groups)[:, None, None] * size + pairs).reshape(-1, 2)
    return features.reshape(-1, K), right.reshape(-1), rivals


@given(st.integers(0, 1000), st.lists(st.floats(-2.0, 2.0), min_size=K, max_size=K))
@settings(max_examples=10, deadline=None)
def test_hidden_weights_are_found_among_rivals(seed, units):
    worth = np.array(units) / (1.0, 0.1, 5.0)
    features, right, rivals = groups_of_rivals(seed, worth, -2.0 * worth[1])
    found = fit(features, right, rivals)
    assert np.abs((found.worth - worth) * (1.0, 0.1, 5.0)).max() < 0.5, "as far as 1500 groups tell"
    p = conditional(found.intercept + features @ found.worth, rivals)
    assert p.reshape(-1, 4).sum(axis=1).max() < 1.0 and p[right].mean() > p[~right].mean()


@given(st.lists(st.tuples(st.floats(-30.0, 30.0), st.integers(0, 2)), min_size=1, max_size=7), st.sampled_from([SAME_READINGS, WITHIN]))
@settings(max_examples=50, deadline=None)
def test_rivals_share_the_probability(told, reason):
    """The localizer's shares, the fit's and those of a slow sum, where each one of a group excludes all others of it."""
    odds, group = np.array([one for one, _ in told]), np.array([number for _, number in told])
    pairs = [(a, b) for b in range(len(odds)) for a in range(b) if group[a] == group[b]]
    p, worth = probabilities(odds, {pair: Rivalry(reason, 0.5, MAX_CLAIMED, "") for pair in pairs}), np.exp(odds)
    for n in range(len(odds)):
        assert p[n] == pytest.approx(worth[n] / (1.0 + worth[group == group[n]].sum()))
    np.testing.assert_allclose(conditional(odds, np.array(pairs, dtype=int).reshape(-1, 2)), p)


def test_what_makes_right_poses_come_first_is_found():
    """Lineups in which the right pose is drawn by hidden weights: the order that is fitted puts it as far ahead as the hidden one."""
    rng, worth = np.random.default_rng(4), np.array([1.5, -2.0, 0.0])
    lineups = []
    for _ in range(400):
        features = rng.normal(size=(30, K))
        share = np.exp(features @ worth)
        lineups.append(Lineup(features, np.where(np.arange(30) == rng.choice(30, p=share / share.sum()), 0, -1)))
    found = fit_order(lineups)
    assert np.abs(found - worth).max() < 0.25

    def rank(weights):
        return np.mean([(one.features @ weights > (one.features @ weights)[one.instance == 0]).sum() for one in lineups])

    assert rank(found) < rank(worth) + 0.2 < rank(np.array([1.0, 1.0, 1.0])) / 3
    assert np.allclose(fit_order([*lineups, Lineup(rng.normal(size=(5, K)), np.full(5, -1))]), found, atol=0.05), "without a right one"


def test_a_scene_is_judged_without_its_own_labels():
    features, right, rivals = groups_of_rivals(3, np.array([1.0, 0.0, 0.2]), 0.0, 150)
    scene, part = np.arange(600) // 4 % 10, np.arange(600) % 2
    lied = np.where(scene % 5 == 2, ~right, right)
    honest, other = (held_out(Weighed(features, label, scene, part, rivals)) for label in (right, lied))
    assert np.allclose(honest[scene % 5 == 2], other[scene % 5 == 2])
    assert not np.allclose(honest[scene % 5 == 1], other[scene % 5 == 1])


def test_the_table_of_probabilities_counts():
    p, right = np.array([0.05, 0.05, 0.35, 0.38, 0.95, 0.95, 1.0 - 1e-9]), np.array([0, 0, 0, 1, 1, 0, 1], bool)
    told = calibration(p, right)
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


def test_poses_on_the_way_are_told_by_their_instance():
    """Many poses at once as the judge measures them one by one; an instance that is hardly seen is no goal."""
    part, rng, T_world_sensor = Library(bundled()).part("brick"), np.random.default_rng(2), from_xyz_rpy((0.1, 0.2, 0.9), (3.0, 0.1, 0.4))
    truth = [TruePose("brick", from_xyz_rpy((0.2 * k, 0.0, 0.03), (0.1, 0.2, k)), (0.9, 0.1, 0.3)[k], 900) for k in range(3)]
    T = [truth[k % 3].T_world_part @ from_xyz_rpy(rng.normal(0, 0.004, 3), rng.normal(0, 0.08, 3)) for k in range(60)]
    T = np.linalg.inv(T_world_sensor) @ T @ part.symmetries[rng.integers(len(part.symmetries), size=60)]
    found = instances_of(T[:, :3, :3], T[:, :3, 3], T_world_sensor, part, truth, 8.0, 8.0)
    for k in range(60):
        mm, degrees = pose_error(T_world_sensor @ T[k], truth[k % 3].T_world_part, part.symmetries)
        assert found[k] == (k % 3 if mm <= 8.0 and degrees <= 8.0 and k % 3 != 1 else -1)
    assert {-1, 0, 2} == set(found.tolist())


def test_the_file_of_weights_is_read_as_it_was_written():
    score = ScoreWeights(1.25, np.arange(len(FEATURES)) - 3.5, np.linspace(0, 1, len(FEATURES)))
    promise = PromiseWeights(np.arange(len(PROMISES)) - 2.5, np.arange(len(PROMISES)) * 0.25)
    table = tomllib.loads(toml(FittedWeights(score, promise)))
    read = weights_from(table)
    assert read.intercept == 1.25 and np.allclose(read.worth, score.worth) and np.allclose(read.typical, score.typical, rtol=1e-3)
    assert np.allclose(promise_weights(table), promise)


def test_the_shipped_weights_are_those_of_the_features():
    assert tuple(TABLE["weights"]) == tuple(TABLE["typical"]) == FEATURES
    assert tuple(TABLE["rough"]) == tuple(TABLE["refined"]) == PROMISES
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
    read, promise = weights_from(tomllib.loads(out.read_text())), promise_weights(tomllib.loads(out.read_text()))
    assert np.isfinite(promise).all() and np.all(np.abs(promise).sum(axis=1) > 0)
    assert np.isfinite(read.worth).all() and (read.worth != 0).any()
    assert main(["fit", "score", "--out", str(tmp_path / "score.json")]) == 2 and ".toml" in capsys.readouterr().err
