"""The last test of an option: the arm's free motions that join the straight ones, and the timed steps of the whole carry."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Posture, Progress, Value, frozen_array
from handey_studio.geometry.transforms import inverse
from handey_studio.grasping import gravity_in_hand
from handey_studio.motion import Certificate, PathOptions, PathResult, Trajectory, certify, plan_path, time_path
from handey_studio.task.ends import End
from handey_studio.task.grasps import CLOSED_MARGIN_M, Grasp, finger_pairs, grip_of, plain, slipping
from handey_studio.task.options import Pairs
from handey_studio.task.plan import Carry, Step, StepKind
from handey_studio.task.removal import held_part
from handey_studio.world import Held, World, arm_of
from handey_studio.world.collision import collision_model

TOLD_M = 0.05  # farther apart than this nobody needs to know how far
TOLD_EVERY = 4  # samples
FINGER_SPEED_M_S = 0.05


@dataclass(frozen=True, eq=False)
class Start(Value):
    """Where the arm is when the plan begins, how far the hand is open, and where the arm goes when all is done."""

    q: NDArray
    opening: float
    q_home: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", frozen_array(self.q))
        object.__setattr__(self, "q_home", frozen_array(self.q_home))


@dataclass(frozen=True, eq=False)
class Carried(Value):
    """One carry planned: its steps, their certificate, and where they leave the arm, `q_end` (joints,) [rad], the hand open by
    `opening_end` [m]."""

    carry: Carry
    steps: tuple[Step, ...]
    certificate: Certificate
    q_end: NDArray
    opening_end: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "q_end", frozen_array(self.q_end))


Kept = dict[tuple, PathResult]
"""Free motions that were asked for in one search, by what they depend on: an answer holds for every option that asks the same."""


def join(
    grasp: Grasp,
    pickup: End,
    putdown: End,
    start: Start,
    last: bool,
    kept: Kept,
    entry: int,
    ledger: Ledger,
    progress: Progress,
    rng: np.random.Generator,
) -> Carried | None:
    """The carry with this grasp and these ends, or None, and the reason in the ledger below `entry`.

    Three free motions, the hardest first: the transfer, to the pickup, and, after the last carry, home.
    """
    goal, choice, held = grasp.option.goal, grasp.choice, held_part(grasp)

    def free(world: World, a: NDArray, b: NDArray, opening: float, carried: Held | None, what: str) -> PathResult | None:
        key = (world, a.tobytes(), b.tobytes(), opening, grasp if carried else None)
        if key not in kept:
            progress.report(0.5, f"planning the arm's motion {what}")
            kept[key] = plan_path(world, a, b, opening, carried, options=PathOptions(straight=carried is None), rng=rng, progress=progress)
        _note(kept[key], what, world.robot.holding(np.array([a, b])), Posture(plain(b), (), opening, goal.instance.name), entry, ledger)
        return kept[key] if kept[key].found else None

    lifted, raised = (pickup.led or pickup.away).q_rad[-1], (putdown.led or putdown.towards).q_rad[0]
    transfer = free(goal.carried, lifted, raised, choice.width, held, "of the transfer")
    there = transfer and free(goal.at_start, start.q, pickup.towards.q_rad[0], choice.opening, None, "to the pickup")
    home = there and last and free(goal.at_goal, putdown.away.q_rad[-1], start.q_home, choice.opening, None, "home")
    if transfer is None or there is None or home is None:
        ledger.fall(entry, "an arm motion was not found")
        return None
    steps, certificate = _steps(grasp, pickup, putdown, start, there, transfer, home or None)
    if not certificate.proved:
        ledger.fall(entry, certificate.reason or "not proved", unit="m", value=certificate.least_clearance,
                    limit=certificate.margin, bodies=certificate.bodies)  # fmt: skip
        return None
    q_held = np.concatenate([step.q_rad for step in steps if step.held])
    grip = grip_of(grasp.option, inverse(choice.T_hand_part), gravity_in_hand(arm_of(goal.carried.robot).hand_pose(q_held)))
    fell = slipping(grip, Posture(plain(raised), (), choice.width, held.name))
    if fell is not None:
        ledger.fall(entry, f"{fell.reason} on the way", value=fell.value, limit=fell.limit, unit=fell.unit, posture=fell.posture)
        return None
    margin = min(float(goal.at_start.robot.limit_margin(step.q_rad).min()) for step in steps)
    choice = replace(choice, joint_margin=margin, grip=grip)
    carry = Carry(grasp.option.T_world_start, goal.T_world_goal, choice, grasp.approach, transfer.space, 0, pickup.run, putdown.run)
    return Carried(carry, steps, certificate, steps[-1].q_rad[-1], choice.opening)


def _note(found: PathResult, what: str, holding: str, posture: Posture, entry: int, ledger: Ledger) -> None:
    """A free motion in the ledger, with what planning it tried, and what stands between its ends if there is none."""
    fell = None if found.found else found.reason
    option = f"{what}, {holding}" if holding else what
    below = ledger.add("arm motion", option, fell, parent=entry, posture=posture if fell else None, bodies=found.separating)
    ledger.adopt(found.entries, parent=below)


def _steps(
    grasp: Grasp, pickup: End, putdown: End, start: Start, there: PathResult, transfer: PathResult, home: PathResult | None
) -> tuple[tuple[Step, ...], Certificate]:
    """The steps of one carry, and one certificate for all."""
    goal, choice, held = grasp.option.goal, grasp.choice, held_part(grasp)
    grip = finger_pairs(held.name)
    lift_pairs, place_pairs = goal.supports_at_start, goal.supports_at_goal
    wide, tight = choice.opening, choice.width
    rows: list[tuple[StepKind, World, PathResult | NDArray, tuple[float, float], Held | None, Pairs]] = [
        ("free", goal.at_start, start.q, (start.opening, wide), None, ()),
        ("free", goal.at_start, there, (wide, wide), None, ()),
        ("approach", goal.at_start, pickup.towards, (wide, wide), None, ()),
        ("close", goal.at_start, pickup.q, (wide, tight), None, grip),
        ("lift", goal.carried, pickup.away, (tight, tight), held, grip + lift_pairs),
        *[("transfer", goal.carried, way, (tight, tight), held, grip) for way in (pickup.led, transfer, putdown.led) if way],
        ("place", goal.carried, putdown.towards, (tight, tight), held, grip + place_pairs),
        ("open", goal.at_goal, putdown.q, (tight, wide), None, grip),
        ("retreat", goal.at_goal, putdown.away, (wide, wide), None, ()),
    ]
    if home is not None:
        rows.append(("free", goal.at_goal, home, (wide, wide), None, ()))
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
    """Least distance (n,) [m] at each time between whatever may not touch, at most `TOLD_M`; looked at some 30 times a second."""
    model, n = collision_model(world), len(timed.time_s)
    looks = np.unique(np.append(np.arange(0, n, TOLD_EVERY), n - 1))
    at = zip(timed.q_rad[looks], timed.hand_opening_m[looks], strict=True)
    return np.interp(np.arange(n), looks, [model.nearest(q, float(opening), held, pairs, limit=TOLD_M) for q, opening in at])


def worst(certificates: list[Certificate]) -> Certificate:
    """One certificate for several stretches: the least clearance of all, `at` counting the stretch; proved when all are."""
    k = min(range(len(certificates)), key=lambda k: (certificates[k].proved, certificates[k].least_clearance))
    pairs = tuple(sorted({pair for certificate in certificates for pair in certificate.pairs_allowed}))
    return replace(certificates[k], at=(k, certificates[k].at[1]), checks=sum(c.checks for c in certificates), pairs_allowed=pairs)


def _unproved() -> Certificate:
    return Certificate(-np.inf, (0, 0.0), (), False, 0.0, reason="a stretch has no certificate")
