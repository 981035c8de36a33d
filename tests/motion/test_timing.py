"""Trajectories: on the curve, within the limits of velocity, acceleration and jerk as differences too, from rest to rest."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.motion import PathResult, Trajectory, time_path
from handey_studio.motion.curve import SAMPLE_S, Curve, rounded, spline
from handey_studio.motion.results import Leg
from handey_studio.world import Robot, arm_of
from tests.motion.oracle import ROBOT

SEEDS, SPREADS = st.integers(0, 2**32 - 1), st.floats(1e-4, 2.0)


def polyline(seed: int, n: int, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """Random points and the widest reach of each corner's blend."""
    points = np.cumsum(np.random.default_rng(seed).normal(0.0, spread, (n, 6)), axis=0)
    spans = (np.abs(np.diff(points, axis=0)) / ROBOT.velocity).max(axis=1)
    return points, np.concatenate([[0.0], np.minimum(spans[:-1], spans[1:]) / 2, [0.0]])


def timed(points: np.ndarray, curve: Curve | None) -> Trajectory:
    return time_path(ROBOT, PathResult("found", "", points, curve=curve), 0.03)


def shares_of_limits(robot: Robot, trajectory: Trajectory) -> np.ndarray:
    """Velocity, acceleration and jerk by differences, as shares of the limits; the arm stands still before and after."""
    q = np.pad(trajectory.q_rad, ((3, 3), (0, 0)), mode="edge")
    steps = [np.abs(np.diff(q, order, axis=0)).max(axis=0) / trajectory.time_s[1] ** order for order in (1, 2, 3)]
    return np.max(np.array(steps) / [robot.velocity, robot.acceleration, robot.jerk], axis=1)


def off_the_curve(curve: Curve, q: np.ndarray) -> float:
    """Greatest distance [rad] of configurations from a finely sampled curve."""
    fine = curve.at(np.linspace(0.0, curve.ends[-1], 4000))
    return max(float(np.linalg.norm(fine - one, axis=1).min()) for one in q[:: max(1, len(q) // 60)])


@settings(max_examples=80, deadline=None)
@given(SEEDS, st.integers(2, 7), SPREADS, st.floats(0.0, 1.0))
@example(0, 4, 1.0, 0.0)
@example(1, 5, 0.3, 1e-3)
def test_differences_of_the_samples_keep_every_limit(seed, n, spread, share):
    points, reaches = polyline(seed, n, spread)
    curve = rounded(points, share * reaches, ROBOT.velocity)
    trajectory = timed(points, curve)
    steps = np.diff(trajectory.time_s)
    assert trajectory.time_s[0] == 0 and np.ptp(steps) < 1e-9 and steps.max() <= SAMPLE_S * (1 + 1e-9)
    assert (trajectory.q_rad[[0, -1]] == points[[0, -1]]).all() and (trajectory.hand_opening_m == 0.03).all()
    shares = shares_of_limits(ROBOT, trajectory)
    assert shares.max() <= 1 + 1e-6
    assert len(steps) < 10 or shares.max() > 0.7  # no slower than it has to be: some limit is all but reached
    assert off_the_curve(curve, trajectory.q_rad) < 2e-3 * curve.ends[-1]


@settings(max_examples=40, deadline=None)
@given(SEEDS, st.integers(2, 40), st.floats(0.001, 0.1))
def test_smooth_ways_keep_every_limit_too(seed, n, step):
    rng = np.random.default_rng(seed)
    directions = np.cumsum(rng.normal(0.0, 0.1, (n, 6)), axis=0) + rng.normal(0.0, 1.0, 6)
    points = np.cumsum(step * directions * rng.uniform(0.5, 1.5, (n, 1)), axis=0)
    curve = spline(points, (np.abs(np.diff(points, axis=0)) / ROBOT.velocity).max(axis=1))
    assert shares_of_limits(ROBOT, timed(points, curve)).max() <= 1 + 1e-6


def test_one_long_segment_takes_the_time_of_an_s_curve():
    points = np.array([ROBOT.home, ROBOT.home + np.array([1.5, 0, 0, 0, 0, 0])])
    v, a, j = ROBOT.velocity[0], ROBOT.acceleration[0], ROBOT.jerk[0]
    assert timed(points, None).time_s[-1] == pytest.approx(1.5 / v + v / a + a / j)
    short = np.array([ROBOT.home, ROBOT.home + np.array([0.001, 0, 0, 0, 0, 0])])
    assert timed(short, None).time_s[-1] == pytest.approx(4 * (0.001 / (2 * j)) ** (1 / 3))


def test_a_rounded_corner_saves_time_and_a_sharp_one_is_a_stop():
    points = ROBOT.home + np.array([np.zeros(6), [1.0, 0, 0, 0, 0, 0], [1.0, 1.0, 0, 0, 0, 0]])
    sharp, wide = timed(points, None), timed(points, rounded(points, np.array([0, 0.3, 0]), ROBOT.velocity))
    stop = np.abs(sharp.q_rad - points[1]).max(axis=1).argmin()
    speeds = np.abs(np.diff(sharp.q_rad, axis=0)).max(axis=1) / sharp.time_s[1]
    assert speeds[stop - 1 : stop + 1].max() < 0.02 and wide.time_s[-1] < 0.9 * sharp.time_s[-1]
    middle = slice(len(wide.time_s) // 4, 3 * len(wide.time_s) // 4)
    assert np.linalg.norm(np.diff(wide.q_rad, axis=0), axis=1)[middle].min() / wide.time_s[1] > 0.3


def test_the_way_back_takes_as_long():
    points, reaches = polyline(3, 5, 0.7)
    there = PathResult("found", "", points, curve=rounded(points, reaches, ROBOT.velocity))
    back = time_path(ROBOT, there.reversed(), 0.03)
    forth = time_path(ROBOT, there, 0.03)
    assert back.time_s[-1] == pytest.approx(forth.time_s[-1], rel=0.02) and (back.q_rad[0] == points[-1]).all()
    assert np.abs(np.diff(back.q_rad, axis=0)).sum() == pytest.approx(np.abs(np.diff(forth.q_rad, axis=0)).sum(), rel=1e-4)


def test_straight_motions_keep_the_tool_s_limits_as_well():
    q = ROBOT.home + np.linspace(0.0, 0.5, 30)[:, None] * [1.0, 0, 0, 0, 0, 0]
    spans = np.full(29, np.linalg.norm(np.diff(arm_of(ROBOT).hand_pose(q[:2])[:, :3, 3], axis=0)) / ROBOT.tool_speed)
    path = PathResult("found", "", q, curve=spline(q, spans), legs=(Leg("straight", 0, 29),))
    for robot in (ROBOT, replace(ROBOT, tool_speed=0.1, tool_acceleration=0.4)):
        trajectory = time_path(robot, path, 0.03)
        places, step = arm_of(ROBOT).hand_pose(trajectory.q_rad)[:, :3, 3], trajectory.time_s[1]
        speed = np.linalg.norm(np.diff(places, axis=0), axis=1) / step
        acceleration = np.linalg.norm(np.diff(places, 2, axis=0), axis=1) / step**2
        assert 0.9 * robot.tool_speed < speed.max() <= robot.tool_speed * 1.001
        assert 0.5 * robot.tool_acceleration < acceleration.max() <= robot.tool_acceleration * 1.01
        assert shares_of_limits(robot, trajectory).max() <= 1 + 1e-6


def test_nothing_to_move_and_bad_input():
    still = timed(np.array([ROBOT.home, ROBOT.home]), None)
    assert len(still.time_s) == 1 and still.hand_opening_m[0] == 0.03
    with pytest.raises(BadInput, match="6 angles"):
        timed(np.zeros((3, 5)), None)
    with pytest.raises(BadInput, match="no way"):
        time_path(ROBOT, PathResult("none", "no way", np.empty((0, 6))), 0.0)
