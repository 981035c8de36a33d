"""Straight motions of the hand, proved."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Ledger
from handey_studio.motion.certificate import MARGIN_M, Mover, certify_with, mover
from handey_studio.motion.hand_way import HandWay, hand_way, slowest
from handey_studio.motion.results import Certificate, Leg, PathResult
from handey_studio.motion.rounding import certify_curve
from handey_studio.world import Held, Robot, World, arm_of
from handey_studio.world.collision import Clearance, Pairs

STAGE = "straight path"
LEAST_M = 1e-4  # bodies that must not touch and come nearer than this do touch, for all that anyone can tell


def straight_path(
    world: World,
    q_start: NDArray,
    T_world_hands: Sequence[NDArray] | NDArray,
    opening: float,
    held: Held | None = None,
    allowed: Pairs = (),
    margin: float = MARGIN_M,
) -> PathResult:
    """The hand in straight lines from pose to pose (k, 4, 4), beginning at `q_start` (joints,) [rad], with the fingers `opening` [m] apart.

    The poses are a few millimetres apart. Follows the branch of the inverse kinematics that `q_start` is on; held joints stay as they are
    there. Between the poses the hand keeps to the lines within 0.2 mm; `off_line` of the result tells how far it leaves them, and its
    ledger which joint slows it. The margin kept is `margin` [m], or half of the least clearance at the poses where that is less; the
    certificate tells. Fails, with the place and the reason, where a pose is out of reach, a joint would jump or leave its limits, or
    bodies meet that are not in `allowed`.
    """
    hands = np.asarray(T_world_hands, dtype=float)
    q_start = np.asarray(q_start, dtype=float)
    if hands.ndim != 3 or hands.shape[1:] != (4, 4) or not len(hands) or not np.isfinite(hands).all():
        raise BadInput(f"a straight motion needs finite hand poses (k ≥ 1, 4, 4), these have shape {hands.shape}.")
    arm, ledger = arm_of(world.robot), Ledger()
    way = hand_way(arm, q_start, hands)
    if way.reason:
        ledger.add(STAGE, f"pose {len(way.points)} of {len(hands)}", way.reason)
        return PathResult("none", way.reason, np.empty((0, arm.n)), entries=ledger.entries)
    mine = mover(world, opening, held, allowed, margin)
    k, nearest = _nearest(mine, way.points)
    if nearest.distance < LEAST_M:
        reason = f"{nearest} at pose {k + 1} of {len(way.points)}"
        ledger.add(STAGE, _told(world.robot, way), reason, value=nearest.distance, limit=LEAST_M, unit="m", bodies=nearest.bodies)
        return PathResult("none", reason, np.empty((0, arm.n)), entries=ledger.entries)
    mine.margin = min(margin, nearest.distance / 2)
    certificate = _certified(mine, way)
    entry = ledger.add(STAGE, _told(world.robot, way), value=certificate.least_clearance, limit=mine.margin, unit="m")
    if not certificate.proved:
        share = (certificate.at[0] + certificate.at[1]) / max(len(way.points) - 1, 1)
        reason = f"{certificate.reason} at {100 * share:.0f} % of the way"
        ledger.fall(entry, reason, value=certificate.least_clearance, limit=mine.margin, unit="m", bodies=certificate.bodies)
        return PathResult("none", reason, np.empty((0, arm.n)), certificate, entries=ledger.entries)
    legs = (Leg("straight", 0, len(way.points) - 1),)
    return PathResult("found", "", way.points, certificate, legs, entries=ledger.entries, curve=way.curve, off_line=way.off_line)


def _nearest(mine: Mover, points: NDArray) -> tuple[int, Clearance]:
    """At which posture anything comes nearest to anything, and how near."""
    clearances = [mine.model.clearance(q, mine.opening, mine.held, mine.allowed, limit=2 * mine.margin) for q in points]
    k = int(np.argmin([clearance.distance for clearance in clearances]))
    return k, clearances[k]


def _certified(mine: Mover, way: HandWay) -> Certificate:
    if way.curve is None:
        return certify_with(mine, way.points)
    return certify_curve(way.curve, [mine] * len(way.curve.pieces), way.curve.ends)


def _told(robot: Robot, way: HandWay) -> str:
    """The way in words: how many postures, how straight, and what slows the hand."""
    words = f"{len(way.points)} postures, the hand within {1e3 * way.off_line:.2f} mm of its line"
    speed, k, joint = slowest(robot, way)
    return f"{words}; {joint} slows it to {speed:.3f} m/s after pose {k + 1}" if joint else words
