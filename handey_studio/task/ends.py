"""The next two tests: arm configurations at both ends, and the straight motions there, in towards the part and away from it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Posture, Value, frozen_array
from handey_studio.grasping import HAND_MARGIN_M, BumpRun
from handey_studio.motion import PathResult, straight_path
from handey_studio.task.grasps import Grasp, hand_posture
from handey_studio.task.options import Pairs
from handey_studio.task.removal import STAGES, Removal, held_part, raised, removal_hands, straight_up
from handey_studio.world import Held, World, arm_of
from handey_studio.world.collision import collision_model

MIN_JOINT_MARGIN_RAD = np.deg2rad(3.0)
PICKUP, PUTDOWN = "pickup", "putdown"


@dataclass(frozen=True, eq=False)
class End(Value):
    """The straight motions at one end for one IK branch `q` (joints,) [rad]: in towards the part, and away from it.

    Where the part in hand does not go straight up or down all the way, `led` is the rest, out of the pickup or into the putdown, and `run`
    what led it, in the direction of time.
    """

    q: NDArray
    towards: PathResult
    away: PathResult
    led: PathResult | None = None
    run: BumpRun | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", frozen_array(self.q))


def reachable(grasp: Grasp, where: str, near: NDArray, ledger: Ledger) -> list[NDArray]:
    """Configurations (n,) that put the hand there within limits and clear of everything, nearest to `near` first."""
    goal, end = grasp.option.goal, 0 if where == PICKUP else 1
    world, T_world_hand = (goal.at_start, goal.at_goal)[end], grasp.hands_at[end]
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


def pickup_end(grasp: Grasp, q: NDArray, way: Removal | None, ledger: Ledger) -> End | None:
    """Approach and lift with one IK branch: straight up, or led out by a `way`."""
    goal, choice = grasp.option.goal, grasp.choice
    into = _straight(grasp, 0, goal.at_start, q, grasp.approach_hands[::-1], choice.opening, None, (), "approach", ledger)
    carried = _carried(grasp, 0, q, way, ledger) if into is not None else None
    if into is None or carried is None:
        return None
    return End(q, into.reversed(), carried[0], carried[1], way.run if way else None)


def putdown_end(grasp: Grasp, q: NDArray, way: Removal | None, ledger: Ledger) -> End | None:
    """Placement and retreat with one IK branch: the placement straight down, or led in by a `way` backwards."""
    goal, choice = grasp.option.goal, grasp.choice
    carried = _carried(grasp, 1, q, way, ledger)
    if carried is None:
        return None
    away = _straight(grasp, 1, goal.at_goal, q, grasp.retreat_hands, choice.opening, None, (), "retreat", ledger)
    up, led = carried
    return None if away is None else End(q, up.reversed(), away, led.reversed() if led else None, way.run.reversed() if way else None)


def _carried(grasp: Grasp, end: int, q: NDArray, way: Removal | None, ledger: Ledger) -> tuple[PathResult, PathResult | None] | None:
    """How hand and part leave the place at one end: straight up all the way, or a bit and then along a way."""
    goal, held, width, T_world_hand = grasp.option.goal, held_part(grasp), grasp.choice.width, grasp.hands_at[end]
    pairs = (goal.supports_at_start, goal.supports_at_goal)[end]
    hands = straight_up(T_world_hand, way.bit) if way else raised(grasp, T_world_hand)
    up = _straight(grasp, end, goal.carried, q, hands, width, held, pairs, ("lift", "place")[end], ledger)
    if up is None or way is None:
        return None if up is None else (up, None)
    led = _straight(grasp, end, goal.carried, up.q_rad[-1], removal_hands(grasp, end, way), width, held, (), STAGES[end], ledger)
    return None if led is None else (up, led)


def _part_at(grasp: Grasp, end: int) -> tuple[str, tuple[float, ...]]:
    posture = hand_posture(grasp.option, grasp.hands_at[0], grasp.choice.opening, end)
    return posture.part, posture.T_world_part


def _straight(
    grasp: Grasp, end: int, world: World, q: NDArray, hands: NDArray, opening: float, held: Held | None, pairs: Pairs, what: str,
    ledger: Ledger,
) -> PathResult | None:  # fmt: skip
    found = straight_path(world, q, hands, opening, held, pairs)
    if found.found:
        return found
    last = found.entries[-1] if found.entries else None
    posture = Posture(tuple(q.tolist()), (), opening, *_part_at(grasp, end))
    ledger.add("straight motion", what, found.reason, parent=grasp.entry, bodies=last.bodies if last else (),
               value=last.value if last else None, limit=last.limit if last else None, unit=last.unit if last else "",
               posture=posture)  # fmt: skip
    return None
