"""Timing: from a path to a trajectory within the joints' velocity and acceleration limits.

The path is not bent: the trajectory runs on the certified polyline itself, also between its samples, since every corner is a
sample and the samples between lie on the straight line. A corner is passed only as fast as lets each joint change its speed
by what its acceleration limit gives in 20 ms; a sharp corner is all but a stop, the bends of a straight motion of the hand are hardly felt.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.motion.results import PathResult, Trajectory
from handey_studio.world import Robot

SAMPLE_S = 0.02


def time_path(robot: Robot, path: PathResult, opening: float) -> Trajectory:
    """The trajectory along a path that was found, from rest to rest, with the fingers `opening` [m] apart.

    On each segment the speed is a trapezoid; samples are at most 20 ms apart. A path of one point, or that stays where it is, takes no
    time and comes back as one sample.
    """
    points = path.q_rad
    if not len(points) or points.shape[1] != len(robot.velocity):
        raise BadInput(f"a path to be timed needs points of {len(robot.velocity)} angles, this one has {points.shape}: {path.reason}.")
    points = points[np.r_[True, np.abs(np.diff(points, axis=0)).max(axis=1) > 1e-12]]
    if len(points) == 1:
        return Trajectory(np.zeros(1), points, np.array([opening]))
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    directions = np.diff(points, axis=0) / lengths[:, None]
    with np.errstate(divide="ignore"):
        fastest = (robot.velocity / np.abs(directions)).min(axis=1)
        hardest = (robot.acceleration / np.abs(directions)).min(axis=1)
    corners = _corner_speeds(robot, directions, lengths, fastest, hardest)
    rows = [(0.0, 0, 0.0)]
    for k, (v0, v1) in enumerate(pairwise(corners)):
        times, places = _trapezoid(lengths[k], v0, v1, fastest[k], hardest[k])
        before = rows[-1][0]
        rows += [(before + t, k, s / lengths[k]) for t, s in zip(times, places, strict=True)]
    time, segment, share = (np.array(column) for column in zip(*rows, strict=True))
    a, b = points[segment], points[segment + 1]
    return Trajectory(time, a + share[:, None] * (b - a), np.full(len(time), opening))


def _corner_speeds(robot: Robot, directions: NDArray, lengths: NDArray, fastest: NDArray, hardest: NDArray) -> NDArray:
    """Speed [rad/s] at each point (n + 1,): what the bend allows, and what can be reached from rest and braked to rest."""
    bend = np.abs(np.diff(directions, axis=0))
    with np.errstate(divide="ignore"):
        through = (robot.acceleration * SAMPLE_S / bend).min(axis=1)
    speeds = np.concatenate([[0.0], np.minimum(through, np.minimum(fastest[:-1], fastest[1:])), [0.0]])
    for k in range(len(lengths)):
        speeds[k + 1] = min(speeds[k + 1], np.sqrt(speeds[k] ** 2 + 2 * hardest[k] * lengths[k]))
    for k in range(len(lengths) - 1, -1, -1):
        speeds[k] = min(speeds[k], np.sqrt(speeds[k + 1] ** 2 + 2 * hardest[k] * lengths[k]))
    return speeds


def _trapezoid(length: float, v0: float, v1: float, most: float, acceleration: float) -> tuple[NDArray, NDArray]:
    """Times [s] and places [rad] along one segment, after its start up to its end."""
    peak = min(most, float(np.sqrt((2 * acceleration * length + v0 * v0 + v1 * v1) / 2)))
    up, down = (peak - v0) / acceleration, (peak - v1) / acceleration
    cruise = max(0.0, length - (peak + v0) / 2 * up - (peak + v1) / 2 * down) / peak
    total = up + cruise + down
    knots = [knot for knot in (up, up + cruise, total) if knot > 0.0]
    t = np.unique(np.concatenate([np.linspace(0.0, total, 1 + max(1, int(np.ceil(total / SAMPLE_S)))), knots]))
    t = t[np.r_[True, np.diff(t) > 1e-9]][1:]
    t[-1] = total
    rising, left = np.minimum(t, up), total - t
    place = v0 * rising + acceleration * rising**2 / 2 + peak * np.clip(t - up, 0.0, cruise)
    braking = left < down
    place[braking] = length - (v1 * left + acceleration * left**2 / 2)[braking]
    place[-1] = length
    return t, place
