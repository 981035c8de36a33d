"""Trajectories: on the polyline, within the limits, from rest to rest."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.motion import time_path
from handey_studio.motion.timing import SAMPLE_S
from tests.motion.oracle import ROBOT


def off_the_polyline(path: np.ndarray, points: np.ndarray) -> float:
    """Greatest distance of points from a polyline."""
    a, b = path[:-1], path[1:]
    ab = b - a
    t = np.clip(((points[:, None] - a) * ab).sum(axis=2) / np.maximum((ab * ab).sum(axis=1), 1e-300), 0.0, 1.0)
    return float(np.linalg.norm(a + t[..., None] * ab - points[:, None], axis=2).min(axis=1).max())


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 7), st.floats(1e-4, 2.0), st.floats(0.05, 1.0))
def test_trajectories_keep_to_path_and_limits(seed, n, spread, speed):
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(0.0, spread, (n, 6)), axis=0)
    openings = rng.uniform(0.0, 0.1, n)
    timed = time_path(ROBOT, path, openings, speed)
    assert timed.time_s[0] == 0 and (np.diff(timed.time_s) > 0).all()
    assert (timed.q_rad[0] == path[0]).all() and np.abs(timed.q_rad[-1] - path[-1]).max() < 1e-9
    assert off_the_polyline(path, timed.q_rad) < 1e-9
    assert off_the_polyline(path, (timed.q_rad[:-1] + timed.q_rad[1:]) / 2) < 1e-9
    for k in range(n):
        nearest = np.abs(timed.q_rad - path[k]).max(axis=1)
        assert nearest.min() < 1e-9
        assert timed.hand_opening_m[np.argmin(nearest)] == pytest.approx(openings[k], abs=1e-9)
    velocity = np.diff(timed.q_rad, axis=0) / np.diff(timed.time_s)[:, None]
    assert (np.abs(velocity) <= ROBOT.velocity * speed * (1 + 1e-6)).all()
    assert np.diff(timed.time_s).max() <= SAMPLE_S / speed * (1 + 1e-6)
    middle = (timed.time_s[1:] + timed.time_s[:-1]) / 2
    gained = np.abs(np.diff(velocity, axis=0)) / speed
    given_time = np.diff(middle)[:, None] * speed + SAMPLE_S
    assert (gained <= ROBOT.acceleration * given_time * (1 + 1e-6) + 1e-9).all()


def test_one_long_segment_takes_the_trapezoid_s_time():
    path = np.array([ROBOT.home, ROBOT.home + np.array([1.5, 0, 0, 0, 0, 0])])
    v, a = ROBOT.velocity[0], ROBOT.acceleration[0]
    assert time_path(ROBOT, path).time_s[-1] == pytest.approx(1.5 / v + v / a)
    assert time_path(ROBOT, path, speed=0.5).time_s[-1] == pytest.approx(2 * (1.5 / v + v / a))


def test_fine_steps_along_a_line_are_not_slowed():
    ends = np.array([ROBOT.home, ROBOT.home + np.array([1.0, 0.4, -0.3, 0.2, 0.0, 0.5])])
    fine = ends[0] + np.linspace(0, 1, 41)[:, None] * (ends[1] - ends[0])
    assert time_path(ROBOT, fine).time_s[-1] == pytest.approx(time_path(ROBOT, ends).time_s[-1], rel=1e-6)


def test_nothing_to_move_and_bad_input():
    still = time_path(ROBOT, np.array([ROBOT.home, ROBOT.home]), 0.03)
    assert len(still.time_s) == 1 and still.hand_opening_m[0] == 0.03
    with pytest.raises(BadInput, match="speed"):
        time_path(ROBOT, [ROBOT.home], speed=0.0)
    with pytest.raises(BadInput, match="finite"):
        time_path(ROBOT, np.zeros((3, 5)))
