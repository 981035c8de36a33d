"""From a grasp to a full plan: the arm's way there, the close, the lift, the transfer, the placement, the retreat and home."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Progress, Value, frozen_array
from handey_studio.motion import Certificate, PathOptions, PathResult, Trajectory, certify, plan_path, straight_path, time_path
from handey_studio.task.grasp_search import CLOSED_MARGIN_M, Grasp, finger_pairs, reachable
from handey_studio.task.options import Pairs
from handey_studio.task.plan import MovePlan, Step, StepKind
from handey_studio.world import Held, World
from handey_studio.world.collision import collision_model

HEIGHTS_M = (0.06, 0.10, 0.14, 0.18)  # straight up from where the part stands: the first at which nothing is near any more
CLEAR_M = 0.003
TOLD_M = 0.05  # farther apart than this nobody needs to know how far
STRAIGHT_STEP_M = 0.005
FINGER_SPEED_M_S = 0.05
MAX_PAIRS = 6  # IK branches at pickup × putdown that are tried for one grasp


@dataclass(frozen=True, eq=False)
class Start(Value):
    """Where the arm is when the plan begins, and where it goes when it is done."""

    q: NDArray
    opening: float
    q_home: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", frozen_array(self.q))
        object.__setattr__(self, "q_home", frozen_array(self.q_home))


@dataclass(frozen=True, eq=False)
class _End(Value):
    """The straight motions at one end for one IK branch: in towards the part, and away from it."""

    q: NDArray
    towards: PathResult
    away: PathResult


def complete(grasp: Grasp, start: Start, ledger: Ledger, progress: Progress, rng: np.random.Generator) -> MovePlan | None:
    """A plan with this grasp, or None, and the reasons in the ledger below the grasp's entry."""
    goal, choice, robot = grasp.option.goal, grasp.choice, grasp.option.goal.at_start.robot
    pickups = reachable(goal.at_start, grasp.T_world_hand_pickup, choice.opening, start.q, "pickup", grasp.entry, ledger)
    putdowns = reachable(goal.at_goal, grasp.T_world_hand_putdown, choice.opening, start.q, "putdown", grasp.entry, ledger)
    if not pickups or not putdowns:
        ledger.fall(grasp.entry, f"no arm configuration is free at the {'putdown' if pickups else 'pickup'}")
        return None
    ends: dict[int, _End | None] = {}
    others: dict[int, _End | None] = {}
    joined = False
    for a, b in _pairs(pickups, putdowns, start.q, robot.held_index)[:MAX_PAIRS]:
        if a not in ends:
            ends[a] = _pickup_end(grasp, pickups[a], ledger)
        if b not in others and ends[a] is not None:
            others[b] = _putdown_end(grasp, putdowns[b], ledger)
        pickup, putdown = ends[a], others.get(b)
        if pickup is None or putdown is None or progress.cancelled:
            continue
        joined = True
        plan = _carry(grasp, pickup, putdown, start, ledger, progress, rng)
        if plan is not None:
            return plan
    ledger.fall(grasp.entry, "no pair of arm configurations is joined by free paths" if joined else "no straight way in and out is free")
    return None


def _pairs(pickups: list[NDArray], putdowns: list[NDArray], q: NDArray, held: NDArray) -> list[tuple[int, int]]:
    """Which branch at the pickup with which at the putdown: those that turn the held joints least first, then the least joint motion."""

    def cost(pair: tuple[int, int]) -> tuple[float, float]:
        there, between = np.abs(pickups[pair[0]] - q), np.abs(putdowns[pair[1]] - pickups[pair[0]])
        return float(there[held].sum() + between[held].sum()), float(there.max() + between.max())

    return sorted(((a, b) for a in range(len(pickups)) for b in range(len(putdowns))), key=cost)


def held_part(grasp: Grasp) -> Held:
    """The part in the hand after this grasp."""
    return Held(grasp.option.goal.instance.name, grasp.option.goal.instance.part, grasp.choice.T_hand_part)


def _pickup_end(grasp: Grasp, q: NDArray, ledger: Ledger) -> _End | None:
    """Approach and lift with one IK branch."""
    goal, choice = grasp.option.goal, grasp.choice
    into = _straight(goal.at_start, q, grasp.approach_hands[::-1], choice.opening, None, (), "approach", grasp.entry, ledger)
    if into is None:
        return None
    lifted = _raised(grasp, grasp.T_world_hand_pickup)
    allowed = goal.supports_at_start
    away = _straight(goal.carried, q, lifted, choice.width, held_part(grasp), allowed, "lift", grasp.entry, ledger)
    return None if away is None else _End(q, into.reversed(), away)


def _putdown_end(grasp: Grasp, q: NDArray, ledger: Ledger) -> _End | None:
    """Placement and retreat with one IK branch."""
    goal, choice = grasp.option.goal, grasp.choice
    raised = _raised(grasp, grasp.T_world_hand_putdown)
    down = _straight(goal.carried, q, raised, choice.width, held_part(grasp), goal.supports_at_goal, "place", grasp.entry, ledger)
    if down is None:
        return None
    away = _straight(goal.at_goal, q, grasp.retreat_hands, choice.opening, None, (), "retreat", grasp.entry, ledger)
    return None if away is None else _End(q, down.reversed(), away)


def _carry(
    grasp: Grasp, pickup: _End, putdown: _End, start: Start, ledger: Ledger, progress: Progress, rng: np.random.Generator
) -> MovePlan | None:
    """The three free motions that join the straight ones, hardest first, and the steps of all."""
    goal, choice = grasp.option.goal, grasp.choice
    held = held_part(grasp)

    def free(world: World, a: NDArray, b: NDArray, opening: float, carried: Held | None, what: str) -> PathResult | None:
        progress.report(0.5, f"planning the arm's motion: {what}")
        found = plan_path(world, a, b, opening, carried, options=PathOptions(straight=what != "transfer"), rng=rng, progress=progress)
        holding = world.robot.holding(np.array([a, b]))
        entry = ledger.add(
            "arm motion", f"{what}, {holding}" if holding else what, None if found.found else found.reason, parent=grasp.entry
        )
        ledger.adopt(found.entries, parent=entry)
        return found if found.found else None

    lifted, raised = pickup.away.q_rad[-1], putdown.towards.q_rad[0]
    transfer = free(goal.carried, lifted, raised, choice.width, held, "transfer")
    there = transfer and free(goal.at_start, start.q, pickup.towards.q_rad[0], choice.opening, None, "to the pickup")
    home = there and free(goal.at_goal, putdown.away.q_rad[-1], start.q_home, choice.opening, None, "home")
    if transfer is None or there is None or home is None:
        return None
    steps, certificate = _steps(grasp, pickup, putdown, start, (there, transfer, home))
    if not certificate.proved:
        ledger.add("certificate", "the whole plan", certificate.reason or "not proved", parent=grasp.entry, unit="m",
                   value=certificate.least_clearance, limit=certificate.margin, bodies=certificate.bodies)  # fmt: skip
        return None
    margin = min(float(goal.at_start.robot.limit_margin(step.q_rad).min()) for step in steps)
    return MovePlan(
        part=goal.instance.name,
        T_world_part_start=grasp.option.T_world_start,
        T_world_part_goal=goal.T_world_goal,
        grasp=replace(choice, joint_margin=margin),
        steps=steps,
        certificate=certificate,
        approach=grasp.approach,
        space=transfer.space,
    )


def _steps(
    grasp: Grasp, pickup: _End, putdown: _End, start: Start, free: tuple[PathResult, PathResult, PathResult]
) -> tuple[tuple[Step, ...], Certificate]:
    """The nine steps of a MOVE without regrasp, and one certificate for all."""
    goal, choice, held = grasp.option.goal, grasp.choice, held_part(grasp)
    there, transfer, home = free
    grip = finger_pairs(held.name)
    lift_pairs, place_pairs = goal.supports_at_start, goal.supports_at_goal
    wide, tight = choice.opening, choice.width
    rows: list[tuple[StepKind, World, PathResult | NDArray, tuple[float, float], Held | None, Pairs]] = [
        ("free", goal.at_start, start.q, (start.opening, wide), None, ()),
        ("free", goal.at_start, there, (wide, wide), None, ()),
        ("approach", goal.at_start, pickup.towards, (wide, wide), None, ()),
        ("close", goal.at_start, pickup.q, (wide, tight), None, grip),
        ("lift", goal.carried, pickup.away, (tight, tight), held, grip + lift_pairs),
        ("transfer", goal.carried, transfer, (tight, tight), held, grip),
        ("place", goal.carried, putdown.towards, (tight, tight), held, grip + place_pairs),
        ("open", goal.at_goal, putdown.q, (tight, wide), None, grip),
        ("retreat", goal.at_goal, putdown.away, (wide, wide), None, ()),
        ("free", goal.at_goal, home, (wide, wide), None, ()),
    ]
    certificates = [
        way.certificate or _unproved()
        if isinstance(way, PathResult)
        else certify(world, np.array([way, way]), np.array(openings), None, pairs, CLOSED_MARGIN_M)
        for _, world, way, openings, _, pairs in rows
    ]
    return tuple(_step(*row) for row in rows), worst(certificates)


def _step(kind: StepKind, world: World, way: PathResult | NDArray, openings: tuple[float, float], held: Held | None, pairs: Pairs) -> Step:
    """One timed step; a configuration (joints,) in place of a path means that only the fingers move."""
    if isinstance(way, PathResult):
        timed = time_path(world.robot, way, openings[0])
    else:
        seconds = max(abs(openings[1] - openings[0]) / FINGER_SPEED_M_S, 0.1)
        timed = Trajectory(np.array([0.0, seconds]), np.array([way, way]), np.array(openings))
    return Step(
        kind,
        world.robot.joint_names,
        timed.time_s,
        timed.q_rad,
        timed.hand_opening_m,
        held.name if held else None,
        held.T_hand_part if held else None,
        pairs,
        _clearances(world, timed, held, pairs),
    )


def _clearances(world: World, timed: Trajectory, held: Held | None, pairs: Pairs) -> NDArray:
    """Least distance (n,) [m] at each time between whatever may not touch, at most `TOLD_M`."""
    model = collision_model(world)
    at = zip(timed.q_rad, timed.hand_opening_m, strict=True)
    return np.array([min(model.clearance(q, float(opening), held, pairs, limit=TOLD_M).distance, TOLD_M) for q, opening in at])


def worst(certificates: list[Certificate]) -> Certificate:
    """One certificate for several stretches: the least clearance of all, `at` counting the stretch; proved when all are."""
    k = min(range(len(certificates)), key=lambda k: (certificates[k].proved, certificates[k].least_clearance))
    pairs = tuple(sorted({pair for certificate in certificates for pair in certificate.pairs_allowed}))
    return replace(certificates[k], at=(k, certificates[k].at[1]), checks=sum(c.checks for c in certificates), pairs_allowed=pairs)


def _unproved() -> Certificate:
    return Certificate(-np.inf, (0, 0.0), (), False, 0.0, reason="a stretch has no certificate")


def _straight(
    world: World, q: NDArray, hands: NDArray, opening: float, held: Held | None, pairs: Pairs, what: str, parent: int, ledger: Ledger
) -> PathResult | None:
    found = straight_path(world, q, hands, opening, held, pairs)
    if found.found:
        return found
    entry = ledger.add("straight motion", what, found.reason, parent=parent)
    ledger.adopt(found.entries, parent=entry)
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
