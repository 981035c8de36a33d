"""A path between two configurations in a scene of known bodies: read, planned, timed, and told as JSON (schema `handey/path/1`)."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handey_studio.base import Progress, Silent
from handey_studio.motion import PathOptions, PathResult, Trajectory, plan_path, time_path
from handey_studio.task.report import certificate_report, entry_report, plain
from handey_studio.world import Robot
from handey_studio.world.envelope import enveloped
from handey_studio.world.moveit import read_request, read_scene


@dataclass(frozen=True)
class PathAnswer:
    """A path or why there is none, its trajectory if there is one, and the seconds that each stage took."""

    robot: Robot
    result: PathResult
    trajectory: Trajectory | None
    timing_s: dict[str, float]


def answer_path(
    robot: Robot, scene: Path, request: Path, options: PathOptions | None = None, seed: int = 0, progress: Progress | None = None
) -> PathAnswer:
    """The answer to a MoveIt scene and request. Nothing is said of the hand's opening, so the path is safe at every one.

    Raises BadInput when a file cannot be read.
    """
    begun = time.perf_counter()
    robot = enveloped(robot)
    world, asked = read_scene(scene, robot), read_request(request, robot)
    read = time.perf_counter()
    opening, rng = robot.hand.opening_min, np.random.default_rng(seed)
    result = plan_path(world, asked.start, asked.goal, opening, options=options, rng=rng, progress=progress or Silent())
    planned = time.perf_counter()
    trajectory = time_path(robot, result.q_rad) if result.found else None
    timing = {"read": read - begun, "plan": planned - read, "time": time.perf_counter() - planned}
    return PathAnswer(robot, result, trajectory, timing)


def path_report(answer: PathAnswer) -> dict[str, Any]:
    """The answer as other programs read it."""
    result, trajectory = answer.result, answer.trajectory
    return {
        "schema": "handey/path/1",
        "robot": answer.robot.name,
        "status": result.status,
        "reason": result.reason,
        "needed": result.needed,
        "joint_names": list(answer.robot.joint_names),
        "time_s": plain(trajectory.time_s) if trajectory else [],
        "q_rad": plain(trajectory.q_rad) if trajectory else [],
        "waypoints_rad": plain(result.q_rad),
        "certificate": certificate_report(result.certificate) if result.certificate else None,
        "ledger": [entry_report(entry) for entry in result.entries],
        "timing_s": answer.timing_s,
    }
