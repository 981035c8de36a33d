"""The hand's way out at the putdown, seen in the grasp plane as its way in is (Handey 1987 §5.2, Fig. 8)."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import inverse
from handey_studio.task.plan import Carry, MovePlan
from handey_studio.world import Robot, arm_of


def way_out(robot: Robot, plan: MovePlan, carry: Carry) -> NDArray:
    """Points (n, 2) [m] of the hand's origin in y, z of the grasp plane that lies on the part where it was put down, while the hand leaves;
    empty if the plan has no such step."""
    after = [step for k, step in enumerate(plan.steps) if k >= carry.first_step and plan.carry_at(k) is carry]
    leaving = [step.q_rad for step in after if step.kind == "retreat"]
    if not leaving:
        return np.empty((0, 2))
    hands = arm_of(robot).hand_pose(np.concatenate(leaving))
    T_plane_world = inverse(carry.T_world_part_goal @ carry.grasp.T_part_plane)
    return (T_plane_world @ hands)[:, 1:3, 3]
