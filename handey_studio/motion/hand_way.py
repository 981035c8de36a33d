"""The arm's way for straight lines of the hand: postures along one branch of the inverse kinematics, and a curve close to the lines."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handey_studio.geometry.transforms import pose_difference, transform
from handey_studio.motion.curve import Curve, spline
from handey_studio.world import Arm, Robot

JUMP_RAD = 0.35  # from one pose to the next, millimetres on, a joint on the same branch turns less than this
LINE_M = 2e-4  # the hand leaves the straight lines from pose to pose by no more, also where they meet at an angle
HALVINGS = 6  # of the way between poses, until that is so
SAME_POSE = (1e-4, 1e-3)  # m, rad: the arm stands at the first pose already
LOOKS = np.arange(1, 11) / 10.0  # where between two postures the hand is looked at


@dataclass(frozen=True, eq=False)
class HandWay:
    """Hand poses (n, 4, 4) and the posture (n, joints) [rad] for each, as far as they go; `reason` why no farther.

    A whole way of two postures or more has the arm's `curve`, and on it the hand is at most `off_line` [m] from the straight lines.
    """

    hands: NDArray
    points: NDArray
    reason: str = ""
    curve: Curve | None = None
    off_line: float = 0.0


def hand_way(arm: Arm, q_start: NDArray, hands: NDArray) -> HandWay:
    """The way through hand poses (k, 4, 4) from a posture (joints,) [rad]; `reason` tells where it ends before the last of them."""
    here = arm.hand_pose(q_start)
    kept, points = [here], [q_start]
    metres, radians = pose_difference(here, hands[0])
    first = 1 if metres < SAME_POSE[0] and radians < SAME_POSE[1] else 0
    for k in range(first, len(hands)):
        q, reason = _next(arm, hands[k], points[-1], f"pose {k + 1} of {len(hands)}")
        if reason:
            return HandWay(np.array(kept), np.array(points), reason)
        if np.abs(q - points[-1]).max() > 1e-9:
            kept.append(hands[k])
            points.append(q)
    return _keeping_to_lines(arm, np.array(kept), np.array(points))


def slowest(robot: Robot, way: HandWay) -> tuple[float, int, str]:
    """How fast [m/s] the hand may go where it has to go slowest, between which pose and the next, and the joint that slows it; the
    tool's speed and no joint where none does."""
    moved = np.linalg.norm(np.diff(way.hands[:, :3, 3], axis=0), axis=1)
    joint_s = np.abs(np.diff(way.points, axis=0)) / robot.velocity
    speeds = moved / np.maximum(joint_s.max(axis=1), 1e-12)
    speeds[moved < 1e-6] = np.inf
    if not len(speeds) or speeds.min() >= robot.tool_speed:
        return robot.tool_speed, 0, ""
    k = int(np.argmin(speeds))
    return float(speeds[k]), k, robot.joint_names[int(np.argmax(joint_s[k]))]


def _next(arm: Arm, T_world_hand: NDArray, here: NDArray, place: str) -> tuple[NDArray, str]:
    """The posture for a pose on the branch of the last one, and why there is none."""
    branches = arm.nearest_turns(arm.ik(T_world_hand, here[arm.robot.held_index]), here)
    if not len(branches):
        return here, f"{place} is out of reach"
    jumps = np.abs(branches - here).max(axis=1)
    q = branches[int(np.argmin(jumps))]
    if jumps.min() > JUMP_RAD:
        joint, most = arm.robot.joint_names[int(np.argmax(np.abs(q - here)))], np.rad2deg([jumps.min(), JUMP_RAD])
        return here, f"{joint} would jump by {most[0]:.0f}° at {place}, more than {most[1]:.0f}°"
    over = arm.robot.limit_margin(q)
    if over < 0:
        joint = arm.robot.joint_names[int(np.argmin(np.minimum(q - arm.robot.lower, arm.robot.upper - q)))]
        return here, f"{joint} leaves its limits by {np.rad2deg(-over):.1f}° at {place}"
    return q, ""


def _keeping_to_lines(arm: Arm, hands: NDArray, points: NDArray) -> HandWay:
    """The way with as many postures between its own as keep the hand on the lines."""
    for _ in range(HALVINGS):
        if len(points) == 1:
            return HandWay(hands, points)
        curve = spline(points, _spans(arm.robot, hands, points))
        off = _off_lines(arm, curve, hands)
        wide = np.flatnonzero(off > LINE_M)
        if not len(wide):
            return HandWay(hands, points, "", curve, float(off.max()))
        between = [(k, _halfway(hands[k], hands[k + 1])) for k in wide]
        found = [_next(arm, hand, points[k], f"the middle of poses {k + 1} and {k + 2}") for k, hand in between]
        reason = next((reason for _, reason in found if reason), "")
        if reason:
            return HandWay(hands, points, reason)
        hands = np.insert(hands, wide + 1, [hand for _, hand in between], axis=0)
        points = np.insert(points, wide + 1, [q for q, _ in found], axis=0)
    return HandWay(hands, points, f"the hand leaves its line by {1e3 * off.max():.2f} mm, more than {1e3 * LINE_M:.1f} mm")


def _spans(robot: Robot, hands: NDArray, points: NDArray) -> NDArray:
    """The least time (n - 1,) [s] from each posture to the next within the speeds of tool and joints."""
    moved = np.linalg.norm(np.diff(hands[:, :3, 3], axis=0), axis=1)
    return np.maximum(moved / robot.tool_speed, (np.abs(np.diff(points, axis=0)) / robot.velocity).max(axis=1))


def _off_lines(arm: Arm, curve: Curve, hands: NDArray) -> NDArray:
    """How far (n - 1,) [m] the hand is, between each pose and the next, from the line between them or from a neighbouring one."""
    places = arm.hand_pose(curve.at((curve.ends[:-1, None] + curve.lengths[:, None] * LOOKS).ravel()))[:, :3, 3].reshape(-1, len(LOOKS), 3)
    origins = hands[:, :3, 3]
    n = len(origins) - 1
    distances = []
    for shift in (-1, 0, 1):
        k = np.clip(np.arange(n) + shift, 0, n - 1)
        along = origins[k + 1] - origins[k]
        left = places - origins[k][:, None]
        share = np.einsum("klx,kx->kl", left, along) / np.maximum(np.einsum("kx,kx->k", along, along), 1e-18)[:, None]
        distances.append(np.linalg.norm(left - np.clip(share, 0.0, 1.0)[..., None] * along[:, None], axis=2))
    return np.min(distances, axis=0).max(axis=1)


def _halfway(T_a: NDArray, T_b: NDArray) -> NDArray:
    """The pose (4, 4) halfway between two."""
    turn = Rotation.from_matrix(T_a[:3, :3].T @ T_b[:3, :3]).as_rotvec()
    return transform(T_a[:3, :3] @ Rotation.from_rotvec(turn / 2.0).as_matrix(), (T_a[:3, 3] + T_b[:3, 3]) / 2.0)
