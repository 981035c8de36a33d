"""Paths to hand poses: every branch counts, the shortest path wins, and what failed is told."""

import numpy as np

from handey_studio.geometry.transforms import transform
from handey_studio.motion import PathOptions, plan_path, plan_reach
from handey_studio.motion.reach import length, reachable
from handey_studio.world import Block, World, arm_of
from handey_studio.world.collision import collision_model
from tests.motion.oracle import DOWN, ROBOT, Judge

CHEAP = PathOptions(steps_deg=(5.0,), tree_growths=0)
START = ROBOT.home + np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
HAND = transform(DOWN[:3, :3], [0.45, 0.15, 0.15])


def test_the_shortest_of_all_branches_wins():
    world = World(ROBOT)
    goals = reachable(world, ROBOT.home, HAND)
    found = plan_reach(world, ROBOT.home, HAND, 0.05)
    assert len(goals) >= 4 and found.found and found.certificate is not None and found.certificate.proved
    assert np.abs(arm_of(ROBOT).hand_pose(found.q_rad[-1]) - HAND).max() < 1e-6
    others = [plan_path(world, ROBOT.home, goal, 0.05, options=CHEAP) for goal in goals]
    assert length(found) <= min(length(other) for other in others if other.found) + 0.05


def knobs():
    """Worlds with a block where one of the branches has its elbow, away from the start, and the branch's number."""
    for k, goal in enumerate(reachable(World(ROBOT), START, HAND)):
        elbow = arm_of(ROBOT).link_poses(goal)[3][:3, 3]
        world = World(ROBOT, blocks=(Block("knob", np.full(3, 0.06), transform(None, elbow)),))
        model = collision_model(world)
        if model.in_contact(START, 0.05) is None and model.in_contact(goal, 0.05) is not None:
            yield world, k


def test_a_branch_that_is_shut_leaves_the_others():
    world, k = next(knobs())
    found = plan_reach(world, START, HAND, 0.05)
    goals = reachable(world, START, HAND)
    assert found.found and np.abs(goals - found.q_rad[-1]).max(axis=1).argmin() != k
    branches = [entry for entry in found.entries if entry.stage == "reach"]
    assert len(branches) <= k or "knob" in str(branches[k].reason)
    assert Judge(world, 0.05).first_meeting(found.q_rad, 0.02) is None


def test_no_branch_and_no_path_are_told():
    far = plan_reach(World(ROBOT), ROBOT.home, transform(DOWN[:3, :3], [2.0, 0.0, 0.2]), 0.05)
    assert far.status == "none" and "no branch" in far.reason
    below = plan_reach(World(ROBOT), ROBOT.home, transform(DOWN[:3, :3], [0.45, 0.1, -0.05]), 0.05)
    assert below.status == "none" and "table" in below.reason and len(below.entries) >= 4
