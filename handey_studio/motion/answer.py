"""A path between two configurations in a scene of known bodies: read, planned, timed, and told as JSON (schema `handey/path/1`)."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handey_studio.base import Progress, Silent, entry_report, finite
from handey_studio.motion.path import plan_path
from handey_studio.motion.query import PathOptions
from handey_studio.motion.results import Certificate, PathResult, Trajectory
from handey_studio.motion.timing import time_path
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
    trajectory = time_path(robot, result, opening) if result.found else None
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
        "proven": result.proven,
        "separating": list(result.separating),
        "needed": result.needed,
        "joint_names": list(answer.robot.joint_names),
        "time_s": trajectory.time_s.tolist() if trajectory else [],
        "q_rad": trajectory.q_rad.tolist() if trajectory else [],
        "waypoints_rad": result.q_rad.tolist(),
        "certificate": certificate_report(result.certificate) if result.certificate else None,
        "ledger": [entry_report(entry) for entry in result.entries],
        "timing_s": answer.timing_s,
    }


def certificate_report(certificate: Certificate) -> dict[str, Any]:
    """What was proved: the least clearance [m], where, between which bodies, and the margin that every pair keeps."""
    return {
        "proved": certificate.proved,
        "least_clearance_m": finite(certificate.least_clearance),
        "bodies": list(certificate.bodies),
        "at_stretch": certificate.at[0],
        "at_share": certificate.at[1],
        "margin_m": certificate.margin,
        "exact_checks": certificate.checks,
        "reason": certificate.reason,
    }
