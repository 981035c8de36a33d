"""A plan as `handey plan` writes it, of real timed motions of the UR5, and quick to make."""

import json
from functools import lru_cache
from typing import Any

import numpy as np

from handey_studio.motion import PathResult, Trajectory, time_path
from handey_studio.world import Library, Robot, arm_of
from handey_studio.world.library import bundled

KINDS = ("free", "free", "approach", "close", "lift", "transfer", "place", "open", "retreat")


@lru_cache
def ur5() -> Robot:
    return Library(bundled()).robot("ur5")


def move_json(seed: int = 0) -> dict[str, Any]:
    """The steps of a pick and place between random configurations near home; a descent goes down some centimetres."""
    robot, rng = ur5(), np.random.default_rng(seed)
    steps, q, opening = [], robot.home, robot.hand.opening_max
    for kind in KINDS:
        to = {"free": 0.06, "close": 0.04, "open": 0.05}.get(kind, opening) if kind in ("close", "open") or not steps else opening
        timed = _fingers(q, opening, to) if to != opening or not steps else _arm(robot, kind, q, opening, rng)
        step = {"time_s": timed.time_s.tolist(), "q_rad": timed.q_rad.tolist(), "hand_opening_m": timed.hand_opening_m.tolist()}
        held = "brick#1" if kind in ("lift", "transfer", "place") else None
        steps.append({"kind": kind, "joint_names": list(robot.joint_names), "held": held, **step})
        q, opening = timed.q_rad[-1], float(timed.hand_opening_m[-1])
    move = {"part": "brick#1", "status": "planned", "reason": "", "steps": steps}
    return {"schema": "handey/move/1", "robot": robot.name, "moves": [move]}


def _fingers(q, opening: float, to: float) -> Trajectory:
    return Trajectory(np.array([0.0, 0.4]), np.array([q, q]), np.array([opening, to]))


def _arm(robot: Robot, kind: str, q, opening: float, rng: np.random.Generator) -> Trajectory:
    goal = q + rng.uniform(-0.4, 0.4, len(q))
    if kind == "place":
        T = arm_of(robot).hand_pose(q)
        T[2, 3] -= 0.04
        branches = arm_of(robot).nearest_turns(arm_of(robot).ik(T), q)
        goal = branches[np.argmin(np.linalg.norm(branches - q, axis=1))]
    return time_path(robot, PathResult("found", "", np.array([q, goal])), opening)


def as_bytes(content: dict[str, Any]) -> bytes:
    return json.dumps(content).encode()
