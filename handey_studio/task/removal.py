"""Where straight up is barred: the part in hand led out of its place in the grasp plane, and into one backwards (Handey 1987 §5.2).

The paper leads the open hand alone. The first bit from the support is straight up all the same, and so the last bit to it straight
down: guarded, so that contact tells the support.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Value
from handey_studio.geometry.transforms import inverse
from handey_studio.grasping import BumpRun, fill_grasp_plane, hand_in_plane, outline_with, plan_removal
from handey_studio.task.grasps import CLOSED_MARGIN_M, Fall, Grasp, hand_posture
from handey_studio.task.options import LAST_BIT_M
from handey_studio.world import Held
from handey_studio.world.collision import CollisionModel, collision_model

BITS_M = (LAST_BIT_M, 0.012, 0.024, 0.048)
ENOUGH_M = 0.02  # farther from everything is no better
HEIGHTS_M = (0.06, 0.10, 0.14, 0.18)  # straight up from where the part stands: the first at which nothing is near any more
CLEAR_M = 0.003
STEP_M = 0.005
STAGES = ("lifting", "lowering")


@dataclass(frozen=True, eq=False)
class Removal(Value):
    """A way of hand and part out of a place: straight up by `bit` [m], then along `run` in the grasp plane, which was raised by as much."""

    bit: float
    run: BumpRun


Known = dict[tuple, Removal | Fall]
"""Removals that were asked for in one search, by what they depend on."""


def held_part(grasp: Grasp) -> Held:
    """The part in the hand after this grasp."""
    return Held(grasp.option.goal.instance.name, grasp.option.goal.instance.part, grasp.choice.T_hand_part)


def straight_up(T_world_hand: NDArray, height: float) -> NDArray:
    """Hand poses (k, 4, 4) from one to so much [m] above it."""
    poses = np.repeat(T_world_hand[None], 2 + int(height / STEP_M), axis=0)
    poses[:, 2, 3] += np.linspace(0.0, height, len(poses))
    return poses


def raised(grasp: Grasp, T_world_hand: NDArray) -> NDArray:
    """Hand poses (k, 4, 4) straight up from one, until the part and the hand are clear of all that they stood beside."""
    model, held = collision_model(grasp.option.goal.carried), held_part(grasp)
    height = next((h for h in HEIGHTS_M if _clearance(model, grasp, T_world_hand, h, held, 2 * CLEAR_M) > CLEAR_M), HEIGHTS_M[-1])
    return straight_up(T_world_hand, height)


def removal(grasp: Grasp, end: int, known: Known, ledger: Ledger) -> Removal | None:
    """How hand and part leave the place at one end (0 pickup, 1 putdown), told in the ledger; None if they cannot.

    They are lifted straight up by what leaves them most room first. Both ways round of the hand have it in common in `known`.
    """
    here, there = (grasp, end), (grasp.option, grasp.approach, end)
    if here not in known:
        known[there] = known[here] = known[there] if there in known else _removal(grasp, end)
        _tell(known[here], grasp, end, ledger)
    found = known[here]
    return found if isinstance(found, Removal) else None


def _removal(grasp: Grasp, end: int) -> Removal | Fall:
    model, held, width, T_world_hand = collision_model(grasp.option.goal.carried), held_part(grasp), grasp.choice.width, grasp.hands_at[end]
    room = [_clearance(model, grasp, T_world_hand, bit, held, ENOUGH_M) for bit in BITS_M]
    bit = BITS_M[int(np.argmax(room))]
    if max(room) < CLOSED_MARGIN_M:
        met = model.hand_contact(straight_up(T_world_hand, bit)[-1], width, held, limit=ENOUGH_M)
        return Fall("hand and part cannot be lifted at all", met.distance, CLOSED_MARGIN_M, "m", met.bodies)
    run = _led(grasp, end, bit)
    if run.status != "reached":
        return Fall("hand and part find no way, by search of all motions in the grasp plane", run.distance, run.threshold, "m")
    return Removal(bit, run)


def _tell(found: Removal | Fall, grasp: Grasp, end: int, ledger: Ledger) -> None:
    if isinstance(found, Removal):
        ledger.add(STAGES[end], f"led by {found.run.found_by}", parent=grasp.entry)
        return
    posture = hand_posture(grasp.option, grasp.hands_at[end], grasp.choice.width, end)
    ledger.add(STAGES[end], "led by bump lines", found.reason, parent=grasp.entry, value=found.value, limit=found.limit, unit=found.unit,
               bodies=found.bodies, posture=posture)  # fmt: skip


def removal_hands(grasp: Grasp, end: int, way: Removal) -> NDArray:
    """Hand poses (k, 4, 4) along a removal, from where the part has been lifted off its support to where all is clear."""
    T_plane = _raised_plane(grasp, end, way.bit)
    out = np.array([T_plane @ hand_in_plane(pose[:2], pose[2], grasp.side) for pose in way.run.path])
    return np.concatenate([out, raised(grasp, out[-1])[1:]])


def _led(grasp: Grasp, end: int, bit: float) -> BumpRun:
    """The run in the raised grasp plane; it is the same for both ways round of the hand."""
    option, pose = grasp.option, grasp.approach.path[-1]
    group, goal = option.group, option.goal
    hand, part = goal.carried.robot.hand, goal.instance.part
    held = Held(goal.instance.name, part, inverse(group.grasp_class.T_part_plane @ hand_in_plane(pose[:2], pose[2], 1)))
    outline, ends = outline_with(hand, held)
    plane = fill_grasp_plane(goal.carried, _raised_plane(grasp, end, bit), pose[:2], hand, grasp.choice.width, ends)
    return plan_removal(plane, outline, pose)


def _raised_plane(grasp: Grasp, end: int, bit: float) -> NDArray:
    T = grasp.parts_at[end] @ grasp.option.group.grasp_class.T_part_plane
    T[2, 3] += bit
    return T


def _clearance(model: CollisionModel, grasp: Grasp, T_world_hand: NDArray, height: float, held: Held, limit: float) -> float:
    """How far [m] hand and part are from all else that much higher, at most `limit`."""
    at = T_world_hand.copy()
    at[2, 3] += height
    clearance = model.hand_contact(at, grasp.choice.width, held, limit=limit)
    return min(clearance.distance, limit)
