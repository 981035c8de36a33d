"""Poses that explain the same readings: told with their probabilities where the view cannot tell them apart, fallen where it can."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.localization import LocateOptions, localize
from handey_studio.localization.accept import OUTDONE
from handey_studio.localization.joint import SAME_POSE, SAME_READINGS, WITHIN, Rivalry, explain_jointly, probabilities
from handey_studio.localization.marginals import marginals
from handey_studio.localization.report import locate_report
from handey_studio.world import Part
from tests.localization.rendering import map_from_above

LOW, HIGH, WIDE = Part("low", box((0.08, 0.05, 0.04))), Part("high", box((0.08, 0.05, 0.06))), Part("wide", box((0.08, 0.06, 0.04)))
STANDING = from_xyz_rpy((0.45, 0.05, 0.02), (0.0, 0.0, 0.4))


@pytest.fixture(scope="module")
def view():
    return map_from_above([(LOW.solid, STANDING)], np.random.default_rng(1)).view()


def test_a_true_ambiguity_is_told(view):
    """Of both boxes one sees the same upper face; without a table nothing tells how far down they reach."""
    result = localize(view, [LOW, HIGH, WIDE], LocateOptions(table_z_m=None))
    (pose,) = result.poses
    (rival,) = pose.rivals
    assert {pose.part, rival.part} == {"low", "high"}
    assert 0.25 < rival.probability <= pose.score < 0.75 and 0.9 < pose.score + rival.probability <= 1.0
    top = {
        name: T[2, 3] + half
        for (name, T), half in zip(sorted([(pose.part, pose.T_world_part), (rival.part, rival.T_world_part)]), (0.03, 0.02), strict=True)
    }
    assert top["high"] == pytest.approx(top["low"], abs=5e-4)
    told = locate_report(result, view.T_world_sensor, {})["poses"][0]["rivals"]
    assert told == [{"part": rival.part, "T_world_part": rival.T_world_part.tolist(), "probability": rival.probability}]
    accepted = next(h for h in result.hypotheses if h.reason is None)
    assert accepted.rivals == pose.rivals


def test_what_falls_to_another_says_to_which(view):
    result = localize(view, [LOW, HIGH, WIDE], LocateOptions(table_z_m=None))
    chosen = next(h for h in result.hypotheses if h.reason is None)
    loser = next(h for h in result.hypotheses if h.part != chosen.part and h.reason in (SAME_READINGS, OUTDONE))
    assert (
        result.ledger[loser.entry].bodies == (result.ledger[chosen.entry].option,) and chosen.part in result.ledger[loser.entry].bodies[0]
    )


def test_the_table_settles_it(view):
    """With a table the high box would stand in it, and nothing is left to doubt."""
    (pose,) = localize(view, [LOW, HIGH, WIDE]).poses
    assert pose.part == "low" and pose.score > 0.9 and pose.rivals == ()


@given(st.lists(st.floats(0.01, 5.0), min_size=1, max_size=9), st.data())
@settings(max_examples=100, deadline=None)
def test_the_best_that_can_stand_together_is_found(worth, data):
    """Against trying every subset; whoever falls, falls to a rival, and to one that stands."""
    n = len(worth)
    pairs = data.draw(st.sets(st.sampled_from([(a, b) for b in range(n) for a in range(b)] or [(0, 0)])))
    rivals = {
        pair: Rivalry(data.draw(st.sampled_from([SAME_POSE, SAME_READINGS, WITHIN])), 1.0, 0.3, "") for pair in pairs if pair[0] < pair[1]
    }
    found = explain_jointly(worth, rivals)
    subsets = [[k for k in range(n) if bits >> k & 1] for bits in range(2**n)]
    best = max(sum(worth[k] for k in s) for s in subsets if not any(a in s and b in s for a, b in rivals))
    assert sum(worth[k] for k in found.chosen) == pytest.approx(best)
    assert not any(a in found.chosen and b in found.chosen for a, b in rivals)
    assert set(found.fell) == set(range(n)) - set(found.chosen)
    for k, (better, rivalry) in found.fell.items():
        assert better in found.chosen and rivals[min(k, better), max(k, better)] == rivalry


@given(st.lists(st.floats(-30.0, 30.0), min_size=1, max_size=8), st.data())
@settings(max_examples=100, deadline=None)
def test_each_hypothesis_is_as_probable_as_the_sets_that_hold_it(odds, data):
    """Against adding up every subset that can stand together."""
    n = len(odds)
    pairs = {(a, b) for a, b in data.draw(st.sets(st.tuples(st.integers(0, n - 1), st.integers(0, n - 1)))) if a != b}
    excluded = [sum(1 << k for k in range(n) if (k, m) in pairs or (m, k) in pairs) for m in range(n)]
    subsets = [[k for k in range(n) if bits >> k & 1] for bits in range(2**n)]
    subsets = [s for s in subsets if not any(a in s and b in s for a, b in pairs)]
    worth = np.exp([sum(odds[k] for k in s) for s in subsets])
    expected = [sum(w for w, s in zip(worth, subsets, strict=True) if k in s) / worth.sum() for k in range(n)]
    assert marginals(np.array(odds), excluded) == pytest.approx(expected, rel=1e-9)


def test_many_sure_hypotheses_that_exclude_one_another_share_the_probability():
    all_others = [((1 << 60) - 1) & ~(1 << k) for k in range(60)]
    assert marginals(np.full(60, 40.0), all_others) == pytest.approx(np.full(60, 1.0 / 60.0))


def test_what_passes_through_a_sure_pose_leaves_its_readings_to_its_rival():
    """Two poses that explain the same readings, of which one would pass through a third that is beyond doubt."""
    odds, alike = np.array([2.0, 2.0, 12.0]), Rivalry(SAME_READINGS, 1.0, 0.3, "")
    even = probabilities(odds, {(0, 1): alike})
    assert even[0] == pytest.approx(even[1])
    settled = probabilities(odds, {(0, 1): alike, (1, 2): Rivalry(WITHIN, 0.02, 0.005, "m")})
    assert settled[0] > 0.85 and settled[1] < 0.01 and settled[2] > 0.99


def test_the_same_pose_found_twice_is_one():
    same, alike = Rivalry(SAME_POSE, 0.001, 0.01, "m"), Rivalry(SAME_READINGS, 1.0, 0.3, "")
    once, twice = np.array([3.0, 1.0]), np.array([3.0 - np.log(2.0), 3.0 - np.log(2.0), 1.0])
    expected = probabilities(once, {(0, 1): alike})
    found = probabilities(twice, {(0, 1): same, (0, 2): alike, (1, 2): alike})
    assert found == pytest.approx([expected[0], expected[0], expected[1]])
