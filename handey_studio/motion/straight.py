"""Straight motions of the hand: through given poses along one branch of the inverse kinematics."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Ledger
from handey_studio.geometry.transforms import pose_difference
from handey_studio.motion.certificate import MARGIN_M, certify_with, mover
from handey_studio.motion.results import Leg, PathResult
from handey_studio.world import Arm, Held, World, arm_of
from handey_studio.world.collision import Pairs

STAGE = "straight path"
JUMP_RAD = 0.35  # from one pose to the next, millimetres on, a joint on the same branch turns less than this
LEAST_M = 1e-4  # bodies that must not touch and come nearer than this do touch, for all that anyone can tell
SAME_POSE = (1e-4, 1e-3)  # m, rad: the start stands at the first pose


def straight_path(
    world: World,
    q_start: NDArray,
    T_world_hands: Sequence[NDArray] | NDArray,
    opening: float,
    held: Held | None = None,
    allowed: Pairs = (),
    margin: float = MARGIN_M,
) -> PathResult:
    """The hand through poses (k, 4, 4), a few millimetres apart, from `q_start` (joints,) [rad], with the fingers `opening` [m] apart.

    Follows the branch of the inverse kinematics that `q_start` is on; held joints stay as they are there. The margin kept is `margin` [m],
    or half of the least clearance at the poses where that is less; the certificate tells. Fails, with the place and the reason, where a
    pose is out of reach, a joint would jump or leave its limits, or bodies meet that are not in `allowed`.
    """
    hands = np.asarray(T_world_hands, dtype=float)
    q_start = np.asarray(q_start, dtype=float)
    if hands.ndim != 3 or hands.shape[1:] != (4, 4) or not len(hands) or not np.isfinite(hands).all():
        raise BadInput(f"a straight motion needs finite hand poses (k ≥ 1, 4, 4), these have shape {hands.shape}.")
    arm = arm_of(world.robot)
    ledger = Ledger()
    first = 1 if _stands_at(arm, q_start, hands[0]) else 0
    points, reason = _follow(arm, q_start, hands, first)
    if reason:
        ledger.add(STAGE, f"pose {len(points) - 1 + first} of {len(hands)}", reason)
        return PathResult("none", reason, np.empty((0, arm.n)), entries=ledger.entries)
    mine = mover(world, opening, held, allowed, margin)
    clearances = [mine.model.clearance(q, opening, held, allowed, limit=2 * margin) for q in points]
    k = int(np.argmin([clearance.distance for clearance in clearances]))
    if clearances[k].distance < LEAST_M:
        reason = f"{clearances[k]} at pose {k + 1} of {len(points)}"
        ledger.add(
            STAGE, f"{len(points)} postures", reason, value=clearances[k].distance, limit=LEAST_M, unit="m", bodies=clearances[k].bodies
        )
        return PathResult("none", reason, np.empty((0, arm.n)), entries=ledger.entries)
    mine.margin = min(margin, clearances[k].distance / 2)
    certificate = certify_with(mine, points)
    entry = ledger.add(STAGE, f"{len(points)} postures", value=certificate.least_clearance, limit=mine.margin, unit="m")
    if not certificate.proved:
        share = (certificate.at[0] + certificate.at[1]) / max(len(points) - 1, 1)
        reason = f"{certificate.reason} at {100 * share:.0f} % of the way"
        ledger.fall(entry, reason, value=certificate.least_clearance, limit=mine.margin, unit="m", bodies=certificate.bodies)
        return PathResult("none", reason, np.empty((0, arm.n)), certificate, entries=ledger.entries)
    return PathResult("found", "", points, certificate, (Leg("straight", 0, len(points) - 1),), entries=ledger.entries)


def _stands_at(arm: Arm, q: NDArray, T_world_hand: NDArray) -> bool:
    metres, radians = pose_difference(arm.hand_pose(q), T_world_hand)
    return metres < SAME_POSE[0] and radians < SAME_POSE[1]


def _follow(arm: Arm, q_start: NDArray, hands: NDArray, first: int) -> tuple[NDArray, str]:
    """Postures (k, joints) pose by pose, as far as they go, and why no farther."""
    points = [q_start]
    for k in range(first, len(hands)):
        here = points[-1]
        branches = arm.nearest_turns(arm.ik(hands[k], here[arm.robot.held_index]), here)
        place = f"pose {k + 1} of {len(hands)}"
        if not len(branches):
            return np.array(points), f"{place} is out of reach"
        jumps = np.abs(branches - here).max(axis=1)
        q = branches[int(np.argmin(jumps))]
        if jumps.min() > JUMP_RAD:
            joint = arm.robot.joint_names[int(np.argmax(np.abs(q - here)))]
            return np.array(points), f"{joint} would jump by {np.rad2deg(jumps.min()):.0f}° at {place}"
        over = arm.robot.limit_margin(q)
        if over < 0:
            joint = arm.robot.joint_names[int(np.argmin(np.minimum(q - arm.robot.lower, arm.robot.upper - q)))]
            return np.array(points), f"{joint} leaves its limits by {np.rad2deg(-over):.1f}° at {place}"
        points.append(q)
    return np.array(points), ""
