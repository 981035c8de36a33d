"""Who is asked for paths, what they answer, and what is found out about an answer."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.check.path_check import path_contacts
from handey_studio.motion import plan_path, warm_up
from handey_studio.task.bench.motion.problems import Problem, length
from handey_studio.world import Robot
from handey_studio.world.collision import collision_model

STEP_RAD = 0.002  # between the configurations that the independent check looks at
CLEARANCE_STEP_RAD = 0.02  # and between those where the distance to everything is measured


@dataclass(frozen=True)
class Answer:
    """A path (n, joints) [rad], with no points when there is none; the seconds to it; why there is none, or what it needed."""

    path: NDArray
    seconds: float
    reason: str = ""
    needed: str = ""


class Method(Protocol):
    """A planner that is measured."""

    @property
    def name(self) -> str: ...

    def plan(self, problem: Problem, seed: int) -> Answer: ...


class Handey:
    """Our own planner: each space built anew, shortening and certificate included."""

    name = "Handey"

    def __init__(self, robot: Robot) -> None:
        warm_up(robot)

    def plan(self, problem: Problem, seed: int) -> Answer:
        rng = np.random.default_rng(seed)
        begun = time.perf_counter()
        result = plan_path(problem.world, problem.start, problem.goal, problem.opening, problem.held, rng=rng)
        return Answer(result.way, time.perf_counter() - begun, result.reason, result.needed)


def judged(problem: Problem, answer: Answer) -> dict[str, Any]:
    """An answer in a row of the table: its length [rad], least clearance [m], and the pairs that collide on it."""
    row: dict[str, Any] = {"seconds": answer.seconds, "reason": answer.reason, "needed": answer.needed, "found": len(answer.path) > 0}
    if not len(answer.path):
        return row
    contacts = path_contacts(problem.world, answer.path, problem.opening, problem.held, STEP_RAD)
    collisions = [{"bodies": list(hit.bodies), "depth_m": hit.depth, "at": hit.time} for hit in contacts]
    clearance = least_clearance(problem, answer.path)
    return row | {"length_rad": length(answer.path), "clearance_m": clearance, "collisions": collisions, "q_rad": answer.path.tolist()}


def ends_free(problem: Problem) -> bool:
    """Whether the start and the goal are within the joints' limits and free."""
    model, robot = collision_model(problem.world), problem.world.robot
    ends = (problem.start, problem.goal)
    return all(robot.limit_margin(q) >= 0 and model.in_contact(q, problem.opening, problem.held) is None for q in ends)


def least_clearance(problem: Problem, path: NDArray) -> float:
    """The least distance [m] that is measured on a path, 0 where bodies meet: between the links' convex pieces and everything else."""
    model, least = collision_model(problem.world), 1.0
    for q in sampled(path, CLEARANCE_STEP_RAD):
        least = min(least, model.clearance(q, problem.opening, problem.held, limit=least).distance)
        if least <= 0:
            return 0.0
    return float(least)


def sampled(path: NDArray, step: float) -> Sequence[NDArray]:
    """Configurations of a joint-linear path no more than `step` [rad] apart in any joint, its points among them."""
    found = [path[0]]
    for a, b in pairwise(path):
        n = max(1, int(np.ceil(np.abs(b - a).max() / step)))
        found += [a + (b - a) * (k / n) for k in range(1, n + 1)]
    return found
