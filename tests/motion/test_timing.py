"""Trajectories: on the polyline, within the limits, from rest to rest."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.motion import PathResult, time_path
from handey_studio.motion.timing import SAMPLE_S
from tests.motion.oracle import ROBOT


def off_the_polyline(path: np.ndarray, points: np.ndarray) -> float:
    """Greatest distance of points from a polyline."""
    a, b = path[:-1], path[1:]
    ab = b - a
    t = np.clip(((points[:, None] - a) * ab).sum(axis=2) / np.maximum((ab * ab).sum(axis=1), 1e-300), 0.0, 1.0)
    return float(np.linalg.norm(a + t[..., None] * ab - points[:, None], axis=2).min(axis=1).max())


def found(path: np.ndarray) -> PathResult:
    return PathResult("found", "", path)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 7), st.floats(1e-4, 2.0))
def test_trajectories_keep_to_path_and_limits(seed, n, spread):
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(0.0, spread, (n, 6)), axis=0)
    timed = time_path(ROBOT, found(path), 0.03)
    assert timed.time_s[0] == 0 and (np.diff(timed.time_s) > 0).all() and (timed.hand_opening_m == 0.03).all()
    assert (timed.q_rad[0] == path[0]).all() and np.abs(timed.q_rad[-1] - path[-1]).max() < 1e-9
    assert off_the_polyline(path, timed.q_rad) < 1e-9
    assert off_the_polyline(path, (timed.q_rad[:-1] + timed.q_rad[1:]) / 2) < 1e-9
    velocity = np.diff(timed.q_rad, axis=0) / np.diff(timed.time_s)[:, None]
    assert (np.abs(velocity) <= ROBOT.velocity * (1 + 1e-6)).all()
    assert np.diff(timed.time_s).max() <= SAMPLE_S * (1 + 1e-6)
    middle = (timed.time_s[1:] + timed.time_s[:-1]) / 2
    gained, given_time = np.abs(np.diff(velocity, axis=0)), np.diff(middle)[:, None] + SAMPLE_S
    assert (gained <= ROBOT.acceleration * given_time * (1 + 1e-6) + 1e-9).all()


def test_one_long_segment_takes_the_trapezoid_s_time():
    path = np.array([ROBOT.home, ROBOT.home + np.array([1.5, 0, 0, 0, 0, 0])])
    v, a = ROBOT.velocity[0], ROBOT.acceleration[0]
    assert time_path(ROBOT, found(path), 0.0).time_s[-1] == pytest.approx(1.5 / v + v / a)


def test_nothing_to_move_and_bad_input():
    still = time_path(ROBOT, found(np.array([ROBOT.home, ROBOT.home])), 0.03)
    assert len(still.time_s) == 1 and still.hand_opening_m[0] == 0.03
    with pytest.raises(BadInput, match="6 angles"):
        time_path(ROBOT, found(np.zeros((3, 5))), 0.0)
    with pytest.raises(BadInput, match="no way"):
        time_path(ROBOT, PathResult("none", "no way", np.empty((0, 6))), 0.0)
