"""Faults made to measure on a plan, for the benchmark: each where it hurts the first attempt at it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value
from handey_studio.cell.faults import Call, Fault
from handey_studio.geometry.transforms import transform
from handey_studio.task.acting.motions import fingers_only
from handey_studio.task.plan import MovePlan
from handey_studio.world import Part, Robot, arm_of

G = 9.81
FAULTS = (
    "slip", "loss", "push", "push held", "bias", "bias of look", "obstacle", "stuck closing", "stuck opening", "jam", "jam for good",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Injected(Value):
    """Faults of a kind; `recoverable` if the MOVE can still be done when they are noticed."""

    kind: str
    faults: tuple[Fault, ...]
    recoverable: bool = True


def faults_of(kind: str, plan: MovePlan, robot: Robot, part: Part, rng: np.random.Generator) -> Injected:
    """The faults of a kind for the first attempt at a plan of a part, whose true body has its name; `rng` draws directions."""
    lift, transfer, travel = _call(plan, "lift"), _call(plan, "transfer"), _seconds(plan, "transfer")
    aside, weight = _aside(rng), G * part.mass
    hold = 2.0 * part.friction * robot.hand.pad_friction * robot.hand.force
    making = {
        "slip": lambda: Fault("slip", *lift, time_s=0.1, size=0.9 * weight / hold, lasts_s=0.25),
        "loss": lambda: Fault("slip", *transfer, time_s=0.3 * travel, size=0.0, lasts_s=1.0),
        "push": lambda: Fault("push", *_call(plan, "approach"), lasts_s=0.06, vector=1.3 * weight * aside, body=part.name),
        "push held": lambda: Fault("push", *transfer, time_s=0.3 * travel, lasts_s=0.012, vector=np.array([0.0, 0.0, -1.3 * hold])),
        "bias": lambda: Fault("bias", "scan", 1, lasts_s=0.0, vector=0.008 * aside),
        "bias of look": lambda: Fault("bias", "scan", 2, lasts_s=0.0, vector=0.008 * aside),
        "obstacle": lambda: _obstacle(plan, robot, transfer),
        "stuck closing": lambda: Fault("stuck", *_call(plan, "close"), lasts_s=2.5, size=plan.carries[0].grasp.width + 0.006),
        "stuck opening": lambda: Fault("stuck", *_call(plan, "open"), lasts_s=1.5, size=robot.hand.opening_max),
        "jam": lambda: Fault("blocked", *transfer, time_s=0.4 * travel, lasts_s=2.0, size=float(robot.arm_index[0])),
        "jam for good": lambda: Fault("blocked", *transfer, time_s=0.4 * travel, size=float(robot.arm_index[0])),
    }
    return Injected(kind, (making[kind](),), kind != "jam for good")


def _call(plan: MovePlan, kind: str) -> tuple[Call, int]:
    """Which of the cell's calls the first step of a kind makes."""
    counts: dict[Call, int] = {"grip": 0, "descend": 0, "follow": 0}
    call: Call = "follow"
    for step in plan.steps:
        call = "grip" if fingers_only(step) else "descend" if step.kind == "place" else "follow"
        counts[call] += 1
        if step.kind == kind:
            break
    return call, counts[call]


def _seconds(plan: MovePlan, kind: str) -> float:
    return next(float(step.time_s[-1]) for step in plan.steps if step.kind == kind)


def _aside(rng: np.random.Generator) -> NDArray:
    turn = rng.uniform(-np.pi, np.pi)
    return np.array([np.cos(turn), np.sin(turn), 0.0])


def _obstacle(plan: MovePlan, robot: Robot, call: tuple[Call, int]) -> Fault:
    """A cuboid in the hand's way in the middle of the transfer, which comes when that begins."""
    transfer = next(step for step in plan.steps if step.kind == "transfer")
    hands = arm_of(robot).hand_pose(transfer.q_rad)[:, :3, 3]
    middle = hands[int(np.argmin(np.abs(np.linalg.norm(hands - hands[0], axis=1) - np.linalg.norm(hands - hands[-1], axis=1))))]
    return Fault("obstacle", *call, vector=np.array([0.04, 0.04, 0.04]), T_world_body=transform(None, middle))
