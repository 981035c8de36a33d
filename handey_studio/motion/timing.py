"""Timing: from a path's curve to a trajectory within the joints' limits of velocity, acceleration and jerk.

The curve is not left. How fast a stretch of it may be run, and how hard, comes from the chain rule: with the curve's parameter s,
q̇ = q's', q̈ = q's'' + q''s'² and q⃛ = q's''' + 3q''s's'' + q'''s'³, where q', q'' and q''' are bounded on each piece. On straight
pieces the first terms have all of the limits; in a bend the held speed has most of them, and the rest is for changing it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.motion.curve import SAMPLE_S, STRAIGHT, Curve, rounded
from handey_studio.motion.results import PathResult, Trajectory
from handey_studio.motion.scurve import Pace, run
from handey_studio.world import Robot, arm_of

BEND_SHARES = (0.95, 0.8)  # the most of acceleration and jerk that a bend may take at the speed that is held
RISE_SHARE = 0.5  # of the jerk that a bend leaves, for the bend while the speed changes; the rest is for how suddenly it changes
ALIKE = (0.8, 0.5)  # pieces whose speeds and accelerations differ by no more than these factors are run as one stretch
CORNER = 1e-6  # pieces whose directions [rad/s] differ by more than this meet in a corner
LOOK_S = 1e-3  # for differences of the hand's place along a curve


class Rows(NamedTuple):
    """What is limited, joints and the hand: bounds (3, m, r) of its first three derivatives on each piece, and limits (3, r) of its
    velocity, acceleration and jerk."""

    bounds: NDArray
    limits: NDArray


def time_path(robot: Robot, path: PathResult, opening: float) -> Trajectory:
    """The trajectory along a path that was found, from rest to rest, with the fingers `opening` [m] apart.

    Straight motions of the hand keep the tool's limits as well. Samples are evenly spaced, at most 8 ms apart, and their differences keep
    the limits. A path without a curve stops at its corners; one that stays where it is takes no time and comes back as one sample.
    """
    if not path.found or path.q_rad.shape[1] != len(robot.velocity):
        raise BadInput(f"a path to be timed needs points of {len(robot.velocity)} angles, this one has {path.q_rad.shape}: {path.reason}.")
    points = path.q_rad[np.r_[True, np.abs(np.diff(path.q_rad, axis=0)).max(axis=1) > 1e-12]]
    if len(points) == 1:
        return Trajectory(np.zeros(1), points, np.array([opening]))
    curve = path.curve or rounded(points, np.zeros(len(points)), robot.velocity)
    rows = _joint_rows(robot, curve)
    lengths, paces, stops = stretches(curve, _with_tool(robot, curve, rows) if path.straight else rows)
    ran = run(lengths, paces, stops)
    time = np.linspace(0.0, ran.seconds, 1 + max(1, int(np.ceil(ran.seconds / SAMPLE_S))))
    q = curve.at(np.minimum(ran.at(time), curve.ends[-1]))
    q[0], q[-1] = points[0], points[-1]
    return Trajectory(time, q, np.full(len(time), opening))


def stretches(curve: Curve, rows: Rows) -> tuple[NDArray, list[Pace], NDArray]:
    """Lengths (n,) [s] of stretches of pieces that are run alike, the pace of each, and (n + 1,) where the curve has a corner."""
    paces = piece_paces(rows)
    bent = curve.reach(2).max(axis=1) >= STRAIGHT
    corners = _corners(curve)
    firsts = [0]
    for k in range(1, len(paces)):
        group = paces[firsts[-1] : k + 1, :2]
        alike = (group.min(axis=0) >= ALIKE * group.max(axis=0)).all()
        if corners[k] or bent[k] != bent[k - 1] or not alike:
            firsts.append(k)
    spans = [slice(first, last) for first, last in zip(firsts, [*firsts[1:], len(paces)], strict=True)]
    lengths = np.array([curve.lengths[span].sum() for span in spans])
    return lengths, [Pace(*paces[span].min(axis=0)) for span in spans], corners[[*firsts, len(paces)]]


def piece_paces(rows: Rows) -> NDArray:
    """Speed, acceleration and jerk (m, 3) of the parameter on each piece, within the limits of every row."""
    first, second, third = rows.bounds
    velocity, acceleration, jerk = rows.limits
    with np.errstate(divide="ignore"):
        bend = np.minimum(np.sqrt(BEND_SHARES[0] * acceleration / second), np.cbrt(BEND_SHARES[1] * jerk / third))
        speed = np.minimum(np.minimum(velocity / first, bend).min(axis=1, keepdims=True), 1.0)
        left = jerk - third * speed**3
        rise = np.minimum((acceleration - second * speed**2) / first, RISE_SHARE * left / (3.0 * second * speed))
        rise = rise.min(axis=1, keepdims=True)
        sudden = (left - 3.0 * second * speed * rise) / first
    return np.concatenate([speed, rise, sudden.min(axis=1, keepdims=True)], axis=1)


def _corners(curve: Curve) -> NDArray:
    """Whether (m + 1,) the curve begins, ends, or changes its direction at once where its pieces meet."""
    jumps = np.abs(curve.pieces[1:, 1] - curve.ending(1)[:-1]).max(axis=1)
    return np.r_[True, jumps > CORNER, True]


def _joint_rows(robot: Robot, curve: Curve) -> Rows:
    bounds = np.array([curve.reach(order) for order in (1, 2, 3)])
    bounds[1:][np.abs(bounds[1:]) < STRAIGHT] = 0.0
    return Rows(bounds, np.array([robot.velocity, robot.acceleration, robot.jerk]))


def _with_tool(robot: Robot, curve: Curve, rows: Rows) -> Rows:
    """With one row more: the hand's place, by differences at the ends and in the middle of each piece."""
    looks = curve.ends[:-1, None] + curve.lengths[:, None] * np.array([0.0, 0.5, 1.0])
    looks = np.clip(looks, LOOK_S, curve.ends[-1] - LOOK_S)[..., None] + np.array([-LOOK_S, 0.0, LOOK_S])
    places = arm_of(robot).hand_pose(curve.at(looks.ravel()))[:, :3, 3].reshape(*looks.shape, 3)
    speed = np.linalg.norm(places[:, :, 2] - places[:, :, 0], axis=-1).max(axis=1) / (2.0 * LOOK_S)
    turn = np.linalg.norm(places[:, :, 2] - 2.0 * places[:, :, 1] + places[:, :, 0], axis=-1).max(axis=1) / LOOK_S**2
    tool = np.stack([speed, turn, np.zeros_like(speed)])[..., None]
    limits = np.array([[robot.tool_speed], [robot.tool_acceleration], [np.inf]])
    return Rows(np.concatenate([rows.bounds, tool], axis=2), np.concatenate([rows.limits, limits], axis=1))
