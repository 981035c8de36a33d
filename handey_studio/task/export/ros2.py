"""Programs for ROS 2: a trajectory_msgs/JointTrajectory a step, and control_msgs/GripperCommand where the fingers move.

In JSON or YAML, as `ros2 topic pub` and action clients take them. Where `guarded` is true, whoever sends it must watch the wrist's force.
"""

import json
from typing import Any

import numpy as np
import yaml

from handey_studio.base import BadInput
from handey_studio.task.export.program import Program, ProgramStep, check_names, kind_of
from handey_studio.task.export.resampling import rates_of
from handey_studio.world import Robot

SCHEMA = "handey/ros2/1"
NANO = 1_000_000_000


def ros2_json(program: Program, robot: Robot) -> str:
    """The program as JSON."""
    return json.dumps(_content(program, robot), indent=1, allow_nan=False) + "\n"


def ros2_yaml(program: Program, robot: Robot) -> str:
    """The program as YAML."""
    return yaml.safe_dump(_content(program, robot), sort_keys=False, default_flow_style=None, width=10_000)


def _content(program: Program, robot: Robot) -> dict[str, Any]:
    steps = [_step(step, program, robot) for step in program.steps]
    return {"schema": SCHEMA, "robot": program.robot, "joint_names": list(program.joint_names), "steps": steps}


def _step(step: ProgramStep, program: Program, robot: Robot) -> dict[str, Any]:
    """A trajectory where the arm moves, else a command for the gripper: the opening at the end, and the force with which it closes."""
    ends = {
        "opening_m": [float(step.opening_m[0]), float(step.opening_m[-1])],
        "duration": _stamp(float(step.time_s[-1])),
        "guarded": step.kind == "place",
    }
    if not step.moves_arm:
        grip = {"command": {"position": float(step.opening_m[-1]), "max_effort": float(robot.hand.force)}}
        return {"kind": step.kind, **ends, "gripper_command": grip}
    velocity, acceleration = rates_of(step)
    points = [
        {"positions": q, "velocities": v, "accelerations": a, "effort": [], "time_from_start": _stamp(time)}
        for q, v, a, time in zip(step.q_rad.tolist(), velocity.tolist(), acceleration.tolist(), step.time_s.tolist(), strict=True)
    ]
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    return {"kind": step.kind, **ends, "joint_trajectory": {"header": header, "joint_names": list(program.joint_names), "points": points}}


def _stamp(seconds: float) -> dict[str, int]:
    nanoseconds = round(seconds * NANO)
    return {"sec": nanoseconds // NANO, "nanosec": nanoseconds % NANO}


def _seconds(stamp: dict[str, int]) -> float:
    return (int(stamp["sec"]) * NANO + int(stamp["nanosec"])) / NANO


def read_ros2(text: str) -> Program:
    """The program that `ros2_json` or `ros2_yaml` wrote, times to the nanosecond. A step of the fingers has its arm where the one before
    left it. Raises BadInput when it is something else."""
    try:
        content = yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
        if content["schema"] != SCHEMA:
            raise BadInput(f'its "schema" must be "{SCHEMA}".')
        names = tuple(content["joint_names"])
        check_names(content["robot"], names)
        return Program(content["robot"], names, _read_steps(content["steps"], len(names)))
    except (yaml.YAMLError, KeyError, TypeError, ValueError, IndexError) as error:
        if isinstance(error, BadInput):
            raise
        raise BadInput(f"it is no program for ROS 2: {' '.join(str(error).split())[:120]}.") from None


def _read_steps(plain: list[dict[str, Any]], joints: int) -> tuple[ProgramStep, ...]:
    first = next(step["joint_trajectory"]["points"][0]["positions"] for step in plain if "joint_trajectory" in step)
    q, steps = np.array(first, dtype=float), []
    for step in plain:
        kind, openings = kind_of(str(step["kind"])), step["opening_m"]
        if "joint_trajectory" in step:
            points = step["joint_trajectory"]["points"]
            times = np.array([_seconds(point["time_from_start"]) for point in points])
            turns = np.array([point["positions"] for point in points], dtype=float).reshape(-1, joints)
            opening = np.full(len(times), float(openings[0]))
        else:
            times, turns = np.array([0.0, _seconds(step["duration"])]), np.array([q, q])
            opening = np.array(openings, dtype=float)
        steps.append(ProgramStep(kind, times, turns, opening))
        q = turns[-1]
    return tuple(steps)
