"""What is noticed while a plan is carried out: by the fingers' width and force, by the wrist, by how motions end.

Every limit is a named number with its reason. A check returns an `Incident`, or None when all is as planned.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value
from handey_studio.cell.protocol import Cell, Moved, Wrench
from handey_studio.geometry.transforms import apply
from handey_studio.task.acting.performance import Incident
from handey_studio.world import Hand, Held

GRIP_TOLERANCE_M = 0.0025  # the fingers' width on a part may differ from the model's by this much
WIDTH_CHANGE_M = 0.0007  # what yielding pads and the drive's own play change while a part is carried; a part that turns changes more
FINGER_M = 0.0015  # fingers that are sent somewhere and end farther off than their drive ever is
LOST_FORCE = 0.3  # of the force at closing: fingers that press less hold nothing
LOST_WEIGHT = 0.5  # of the weight after the lift: what is left when the part hangs on something else, or is gone
LEAST_WEIGHT_N = 0.5  # lighter parts cannot be weighed among the wrist's jerks
SHIFT_M = 0.006  # the centre of mass moved in the hand, by the wrist's torque
EARLY_M = 0.004  # contact this far above the commanded pose is something else than the support
SEARCH_M = 0.001  # and this far below it the descent still looks for its support: no deeper than touching bodies may overlap


@dataclass(frozen=True, eq=False)
class Hold(Value):
    """How the part was held when it had been lifted: the fingers' width [m], their force [N], the weight [N], and `lever` (3,) [N m], what
    the wrist's torque in the hand's frame differs by from that of the model's weight."""

    width: float
    force: float
    weight: float
    lever: np.ndarray


def closed_on(moved: Moved, width: float, step: int) -> Incident | None:
    """After closing: the fingers must be stopped by something of the part's width [m]."""
    off = abs(moved.opening_m - width)
    if not moved.contact and moved.opening_m < width - GRIP_TOLERANCE_M / 2:
        return Incident("missed", step, "the fingers closed on nothing; they are off the part's width by", off, GRIP_TOLERANCE_M, "m")
    if off > GRIP_TOLERANCE_M:
        return Incident("missed", step, "the fingers hold something of another width; it differs by", off, GRIP_TOLERANCE_M, "m")
    if not moved.contact:
        return Incident(
            "missed", step, "the fingers do not press on anything; they are off the part's width by", off, GRIP_TOLERANCE_M, "m"
        )
    return None


def hold_of(cell: Cell, held: Held, T_world_hand: NDArray) -> Hold:
    """How the part is held now."""
    wrench = cell.wrench()
    return Hold(cell.opening(), cell.finger_force(), -float(wrench.force_N[2]), _lever(wrench, held, T_world_hand))


def lifted(now: Hold, width: float, hand: Hand) -> Hold:
    """What a part of a width [m] should feel like after the lift: pressed with the hand's force, and as heavy as it turns out to be."""
    return Hold(width, hand.force, now.weight, now.lever)


def still_held(now: Hold, before: Hold, closing: float, physics: bool, step: int) -> Incident | None:
    """During the carry: width, force, weight and centre of mass against those `before`; `closing` [m] is where empty fingers go."""
    change = abs(now.width - before.width)
    if now.width < closing + WIDTH_CHANGE_M < before.width:
        return Incident("dropped", step, "nothing is between the fingers any more; they closed by", change, WIDTH_CHANGE_M, "m")
    if now.force < LOST_FORCE * before.force:
        return Incident("dropped", step, "the fingers press on nothing any more", now.force, LOST_FORCE * before.force, "N")
    if physics and before.weight > LEAST_WEIGHT_N and now.weight < LOST_WEIGHT * before.weight:
        return Incident("dropped", step, "the wrist no longer feels the part's weight", now.weight, LOST_WEIGHT * before.weight, "N")
    if change > WIDTH_CHANGE_M:
        return Incident("slipped", step, "the part moved in the fingers; their width changed by", change, WIDTH_CHANGE_M, "m")
    if physics and before.weight > LEAST_WEIGHT_N:
        shift = float(np.linalg.norm(now.lever - before.lever)) / before.weight
        if shift > SHIFT_M:
            return Incident("slipped", step, "the part moved in the fingers; its centre of mass went by", shift, SHIFT_M, "m")
    return None


def not_arrived(moved: Moved, commanded: NDArray, step: int, what: str) -> Incident | None:
    """A motion that did not come to its end (joints,) [rad]."""
    if moved.ended not in ("blocked", "stopped"):
        return None
    off = float(np.abs(moved.q_rad - commanded).max())
    kind = "blocked" if moved.ended == "blocked" else "stopped"
    why = "something is in the arm's way" if kind == "blocked" else "the arm was stopped"
    return Incident(kind, step, f"{why} in the step {what}; left to go", off, None, "rad")


def fingers_went(moved: Moved, opening: float, hand: Hand, step: int) -> Incident | None:
    """Fingers that were sent to an opening [m] in free air."""
    off = abs(moved.opening_m - float(np.clip(opening, hand.opening_min, hand.opening_max)))
    if off <= FINGER_M:
        return None
    return Incident("hand stuck", step, "the fingers stay away from where they were sent by", off, FINGER_M, "m")


def gave_way(now: Hold, before: Hold | None, physics: bool, step: int) -> Incident | None:
    """After a descent that felt no touch: whether the support bears the part all the same, `before` being how it was held on the way.
    Fingers that hold it loosely let it be pushed up in them by less force than a touch is told by."""
    if not physics or before is None or before.weight <= LEAST_WEIGHT_N or now.weight >= LOST_WEIGHT * before.weight:
        return None
    return Incident(
        "slipped", step, "the part stands on its support and was pushed up in the fingers; the wrist bears",
        now.weight, LOST_WEIGHT * before.weight, "N", overcome=True,
    )  # fmt: skip


def came_down(height: float, contact: bool, step: int) -> Incident | None:
    """After the guarded descent, `height` [m] of the part above where it was commanded."""
    if contact and height > EARLY_M:
        return Incident("early contact", step, "the descent met something above the destination", height, EARLY_M, "m")
    if not contact:
        return Incident("late contact", step, "the descent met nothing; the part is below the destination by", -height, SEARCH_M, "m")
    return None


def _lever(wrench: Wrench, held: Held, T_world_hand: NDArray) -> NDArray:
    """The wrist's torque in the hand's frame (3,) without that of the part's weight where the model has its centre of mass."""
    R = T_world_hand[:3, :3]
    middle = R @ apply(held.T_hand_part, held.part.solid.volume_and_centroid[1])
    return R.T @ (wrench.torque_Nm - np.cross(middle, wrench.force_N))
