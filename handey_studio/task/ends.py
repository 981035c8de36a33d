"""The next two tests: arm configurations at both ends, and the straight motions there, in towards the part and away from it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Posture, Value, frozen_array
from handey_studio.grasping import HAND_MARGIN_M
from handey_studio.motion import PathResult, straight_path
from handey_studio.task.grasps import Grasp, hand_posture
from handey_studio.task.options import Pairs
from handey_studio.world import Held, World, arm_of
from handey_studio.world.collision import collision_model

HEIGHTS_M = (0.06, 0.10, 0.14, 0.18)  # straight up from where the part stands: the first at which nothing is near any more
CLEAR_M = 0.003
STRAIGHT_STEP_M = 0.005
MIN_JOINT_MARGIN_RAD = np.deg2rad(3.0)
PICKUP, PUTDOWN = "pickup", "putdown"


@dataclass(frozen=True, eq=False)
class End(Value):
    """The straight motions at one end for one IK branch `q` (joints,) [rad]: in towards the part, and away from it."""

    q: NDArray
    towards: PathResult
    away: PathResult

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", frozen_array(self.q))


def held_part(grasp: Grasp) -> Held:
    """The part in the hand after this grasp."""
    return Held(grasp.option.goal.instance.name, grasp.option.goal.instance.part, grasp.choice.T_hand_part)


def reachable(grasp: Grasp, where: str, near: NDArray, ledger: Ledger) -> list[NDArray]:
    """Configurations (n,) that put the hand there within limits and clear of everything, nearest to `near` first."""
    goal, end = grasp.option.goal, 0 if where == PICKUP else 1
    world, T_world_hand = (goal.at_start, grasp.T_world_hand_pickup) if end == 0 else (goal.at_goal, grasp.T_world_hand_putdown)
    arm, opening = arm_of(world.robot), grasp.choice.opening
    branches = arm.nearest_turns(arm.ik(T_world_hand), near)
    if not len(branches):
        distance = float(np.linalg.norm(T_world_hand[:3, 3] - world.robot.T_world_base[:3, 3]))
        ledger.add("reach", f"IK at the {where}", "out of the arm's reach", parent=grasp.entry, value=distance, unit="m",
                   posture=hand_posture(grasp.option, T_world_hand, opening, end))  # fmt: skip
        return []
    free = []
    for k, q in enumerate(branches):
        posture = Posture(tuple(q.tolist()), (), opening, *_part_at(grasp, end))
        margin = float(world.robot.limit_margin(q))
        if margin < MIN_JOINT_MARGIN_RAD:
            ledger.add("reach", f"IK branch {k} at the {where}", "too close to a joint limit", parent=grasp.entry,
                       value=margin, limit=MIN_JOINT_MARGIN_RAD, unit="rad", posture=posture)  # fmt: skip
            continue
        contact = collision_model(world).in_contact(q, opening, margin=HAND_MARGIN_M)
        if contact is not None:
            ledger.add("reach", f"IK branch {k} at the {where}", "the arm collides", parent=grasp.entry, value=contact.distance,
                       limit=HAND_MARGIN_M, unit="m", bodies=contact.bodies, posture=posture)  # fmt: skip
            continue
        free.append(q)
    return sorted(free, key=lambda q: float(np.abs(q - near).max()))


def pickup_end(grasp: Grasp, q: NDArray, ledger: Ledger) -> End | None:
    """Approach and lift with one IK branch."""
    goal, choice = grasp.option.goal, grasp.choice
    into = _straight(grasp, goal.at_start, q, grasp.approach_hands[::-1], choice.opening, None, (), "approach", ledger)
    if into is None:
        return None
    lifted = _raised(grasp, grasp.T_world_hand_pickup)
    away = _straight(grasp, goal.carried, q, lifted, choice.width, held_part(grasp), goal.supports_at_start, "lift", ledger)
    return None if away is None else End(q, into.reversed(), away)


def putdown_end(grasp: Grasp, q: NDArray, ledger: Ledger) -> End | None:
    """Placement and retreat with one IK branch."""
    goal, choice = grasp.option.goal, grasp.choice
    raised = _raised(grasp, grasp.T_world_hand_putdown)
    down = _straight(grasp, goal.carried, q, raised, choice.width, held_part(grasp), goal.supports_at_goal, "place", ledger)
    if down is None:
        return None
    away = _straight(grasp, goal.at_goal, q, grasp.retreat_hands, choice.opening, None, (), "retreat", ledger)
    return None if away is None else End(q, down.reversed(), away)


def _part_at(grasp: Grasp, end: int) -> tuple[str, tuple[float, ...]]:
    posture = hand_posture(grasp.option, grasp.T_world_hand_pickup, grasp.choice.opening, end)
    return posture.part, posture.T_world_part


def _straight(
    grasp: Grasp, world: World, q: NDArray, hands: NDArray, opening: float, held: Held | None, pairs: Pairs, what: str, ledger: Ledger
) -> PathResult | None:
    found = straight_path(world, q, hands, opening, held, pairs)
    if found.found:
        return found
    last = found.entries[-1] if found.entries else None
    posture = Posture(tuple(q.tolist()), (), opening, *_part_at(grasp, 0 if what in ("approach", "lift") else 1))
    ledger.add("straight motion", what, found.reason, parent=grasp.entry, bodies=last.bodies if last else (),
               value=last.value if last else None, limit=last.limit if last else None, unit=last.unit if last else "",
               posture=posture)  # fmt: skip
    return None


def _raised(grasp: Grasp, T_world_hand: NDArray) -> NDArray:
    """Hand poses (k, 4, 4) straight up from one, until the part and the hand are clear of all that they stood beside."""
    model, held = collision_model(grasp.option.goal.carried), held_part(grasp)
    height = HEIGHTS_M[-1]
    for height in HEIGHTS_M:
        raised = T_world_hand.copy()
        raised[2, 3] += height
        if model.hand_contact(raised, grasp.choice.width, held, limit=2 * CLEAR_M).keeps(CLEAR_M):
            break
    poses = np.repeat(T_world_hand[None], 1 + round(height / STRAIGHT_STEP_M), axis=0)
    poses[:, 2, 3] += np.linspace(0.0, height, len(poses))
    return poses
