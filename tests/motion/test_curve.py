"""Curves: smooth where they should be, near the polyline that they come from, and near their chords."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.motion.curve import MOST_CHORDS, SAMPLE_S, Curve, rounded, spline
from tests.motion.oracle import ROBOT

SEEDS, COUNTS = st.integers(0, 2**32 - 1), st.integers(2, 8)


def drawn(seed: int, n: int) -> tuple[np.ndarray, np.ndarray, Curve, Curve]:
    """Random points, the reaches of their corners, and both curves through them."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(0.0, 10 ** rng.uniform(-3, 0.3), (n, 6)), axis=0)
    spans = (np.abs(np.diff(points, axis=0)) / ROBOT.velocity).max(axis=1)
    reaches = np.concatenate([[0.0], rng.uniform(0.01, 0.5, n - 2) * np.minimum(spans[:-1], spans[1:]), [0.0]])
    return points, reaches, rounded(points, reaches, ROBOT.velocity), spline(points, spans)


@settings(max_examples=40, deadline=None)
@given(SEEDS, COUNTS)
def test_pieces_join_up_to_the_second_derivative(seed, n):
    points, _, *curves = drawn(seed, n)
    for curve in curves:
        assert np.abs(curve.at(curve.ends[[0, -1]]) - points[[0, -1]]).max() < 1e-9
        for order in range(3):
            gaps = np.abs(curve.ending(order)[:-1] - curve.at(curve.ends[1:-1], order))
            assert gaps.max(initial=0.0) < 1e-7 * (1 + curve.reach(max(order, 1)).max())


@settings(max_examples=40, deadline=None)
@given(SEEDS, COUNTS)
def test_chords_tell_how_far_the_curve_and_its_samples_are(seed, n):
    for curve in drawn(seed, n)[2:]:
        s, slack = curve.chords()
        points = curve.at(s)
        for t in np.linspace(0.0, 1.0, 9):
            off = np.abs(curve.at(s[:-1] + t * np.diff(s)) - points[:-1] - t * np.diff(points, axis=0))
            assert (off <= slack + 1e-9).all()
        assert len(s) <= MOST_CHORDS * len(curve.pieces) + 1
        bent = np.flatnonzero(slack.any(axis=1))
        here, there = np.clip(s[bent], 0, curve.ends[-1] - SAMPLE_S), np.clip(s[bent] + SAMPLE_S, SAMPLE_S, curve.ends[-1])
        sampled = np.abs(curve.at((here + there) / 2) - (curve.at(here) + curve.at(there)) / 2)
        assert (sampled <= np.max(slack, axis=0, initial=0.0) + 1e-12).all()


@settings(max_examples=40, deadline=None)
@given(SEEDS, COUNTS)
def test_blends_stay_in_their_corner_and_no_joint_is_faster_in_them(seed, n):
    points, reaches, curve, _ = drawn(seed, n)
    places = np.concatenate([[0.0], np.cumsum((np.abs(np.diff(points, axis=0)) / ROBOT.velocity).max(axis=1))])
    assert abs(curve.ends[-1] - places[-1]) < 1e-9
    assert (curve.reach(1) <= ROBOT.velocity * (1 + 1e-9)).all()
    s = np.linspace(0.0, curve.ends[-1], 500)
    line = np.array([np.interp(s, places, column) for column in points.T]).T
    off, nearest = np.linalg.norm(curve.at(s) - line, axis=1), np.abs(s[:, None] - places).min(axis=1)
    assert off[nearest > reaches.max() + 1e-9].max(initial=0.0) < 1e-9
    for k in range(1, n - 1):
        corner = curve.at(places[[k]])[0] - points[k]
        inwards = points[k + 1] / (places[k + 1] - places[k]) + points[k - 1] / (places[k] - places[k - 1])
        inwards = inwards - points[k] * (1 / (places[k + 1] - places[k]) + 1 / (places[k] - places[k - 1]))
        assert np.abs(corner - inwards * reaches[k] * 13 / 72).max() < 1e-9


@settings(max_examples=40, deadline=None)
@given(SEEDS, st.integers(3, 8))
def test_a_spline_keeps_straight_lines_and_does_not_swing_beyond_its_corners(seed, n):
    rng = np.random.default_rng(seed)
    start, along = rng.normal(size=6), rng.normal(size=6)
    places = np.cumsum(rng.uniform(0.5, 2.0, n))
    straight = spline(start + places[:, None] * along, np.diff(places))
    across = along / np.linalg.norm(along)
    left = straight.at(np.linspace(0.0, straight.ends[-1], 50)) - start
    assert np.abs(left - (left @ across)[:, None] * across).max() < 1e-9
    points, *_, curve = drawn(seed, n)
    box = np.sort(points, axis=0)[[0, -1]]
    bend = np.abs(np.diff(points, 2, axis=0)).max(axis=0)
    fine = curve.at(np.linspace(0.0, curve.ends[-1], 200))
    assert (fine >= box[0] - bend).all() and (fine <= box[1] + bend).all()


@settings(max_examples=20, deadline=None)
@given(SEEDS, COUNTS)
def test_the_way_back_is_the_same_way(seed, n):
    for curve in drawn(seed, n)[2:]:
        s, back = np.linspace(0.0, curve.ends[-1], 40), curve.reversed()
        for order in range(3):
            there = (-1.0) ** order * curve.at(s[1:-1], order)
            assert np.abs(back.at(curve.ends[-1] - s[1:-1], order) - there).max() < 1e-6 * (1 + np.abs(there).max())
