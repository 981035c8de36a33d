"""The arm's reach among a group's hand angles: IK branches and joint limits forbid angles as obstacles do (Handey 1987 §5.1)."""

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from handey_studio.grasping.grasp_placement_table import GraspPlacementTable
from handey_studio.grasping.rotations import ENDS, End, ForbiddenRange, GraspEnd, LegalRotations
from handey_studio.world import Robot, arm_of

LEAST_MARGIN_RAD = np.deg2rad(3.0)  # a branch keeps this from every joint limit
TURNED = np.diag([-1.0, -1.0, 1.0, 1.0])  # the hand looks the same with its fingers swapped
TOGETHER: list[End] = ["both"]


def within_reach(rotations: LegalRotations, pickup: GraspEnd, putdown: GraspEnd, count: int) -> tuple[list[float], LegalRotations]:
    """Up to `count` legal hand angles [rad] that the arm reaches at both ends the same way round, the most vertical first.

    The arm's collisions are not looked at. If it reaches none, the rotations come back with all angles forbidden at the end that is out of
    reach, or at both together.
    """
    ends = dict(zip(ENDS, (pickup, putdown), strict=True))

    def reached(angle: float, at: Iterable[GraspEnd]) -> bool:
        return any(all(_reached(e.world.robot, e.hand_pose(rotations.group, angle, side).tobytes()) for e in at) for side in (1, -1))

    angles = rotations.best(count, lambda angle: reached(angle, ends.values()))
    if angles or not rotations.legal:
        return angles, rotations
    looked_at = rotations.candidates()
    beyond: list[End] = [name for name, end in ends.items() if not any(reached(angle, (end,)) for angle in looked_at)]
    lost = [ForbiddenRange(low, high, name, "", "reach") for name in beyond or TOGETHER for low, high in rotations.ranges()]
    return [], replace(rotations, forbidden=(*rotations.forbidden, *lost))


def reached_at(table: GraspPlacementTable, end: GraspEnd, columns: NDArray) -> NDArray:
    """Which of some `columns` (c,) of the table, given as a mask, the arm reaches at one end, either way round of the hand."""
    found, robot = np.zeros(len(columns), dtype=bool), end.world.robot
    for c in np.nonzero(columns)[0]:
        T_world_hand = end.T_world_part @ table.Ts_part_hand[c]
        found[c] = any(_reached(robot, (T_world_hand @ turn).tobytes()) for turn in (np.eye(4), TURNED))
    return found


@lru_cache(maxsize=8192)
def _reached(robot: Robot, pose: bytes) -> bool:
    """Whether a branch of the arm puts the hand at a pose, within joint limits."""
    arm = arm_of(robot)
    branches = arm.nearest_turns(arm.ik(np.frombuffer(pose).reshape(4, 4)), robot.home).reshape(-1, len(robot.home))
    return bool((robot.limit_margin(branches) >= LEAST_MARGIN_RAD).any())
