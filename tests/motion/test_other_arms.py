"""Arm motion for arms that are not a UR5: the held joint of seven, and the Puma; judged by the independent oracle."""

from dataclasses import replace

import numpy as np
import pytest

from handey_studio.motion import PathOptions, plan_path, straight_path
from handey_studio.world import Library, World, arm_of
from handey_studio.world.collision import collision_model
from tests.motion.oracle import DOWN, Judge, scene

LIBRARY = Library.choose()
OPENING = 0.05


def world_of(name) -> World:
    return replace(scene(3), robot=LIBRARY.robot(name))


def reaches(world, rng, held=None):
    """Free configurations within the limits with the hand pointing down above the pile."""
    arm, model = arm_of(world.robot), collision_model(world)
    while True:
        T = DOWN.copy()
        T[:3, 3] = rng.uniform(0.3, 0.55), rng.uniform(-0.25, 0.25), rng.uniform(0.05, 0.25)
        branches = arm.nearest_turns(arm.ik(T, held), arm.robot.home)
        free = [q for q in branches if arm.robot.limit_margin(q) > 0.05 and model.in_contact(q, OPENING, margin=0.003) is None]
        if free:
            yield free[int(rng.integers(len(free)))]


@pytest.mark.parametrize("name", ["puma560", "panda", "xarm7"])
def test_paths_are_found_and_the_judge_finds_no_collision(name):
    world = world_of(name)
    judge, ends = Judge(world, OPENING), reaches(world, np.random.default_rng(5))
    for start in (world.robot.home, next(ends)):
        found = plan_path(world, start, next(ends), OPENING)
        assert found.found and found.certificate is not None and found.certificate.proved, found.reason
        assert judge.first_meeting(found.q_rad, 0.02) is None


def test_a_held_joint_that_turns_far_does_so_at_one_place_and_it_is_told():
    world, rng = world_of("panda"), np.random.default_rng(7)
    ends = [next(reaches(world, rng, np.deg2rad([held]))) for held in (0.0, 35.0)]
    found = plan_path(world, *ends, OPENING, options=PathOptions(straight=False, shortcuts=0))
    assert found.found
    assert "panda_joint3 turned from 0° to 35° at one place" in found.needed
    assert Judge(world, OPENING).first_meeting(found.q_rad, 0.01) is None


@pytest.mark.parametrize("name", ["panda", "xarm7"])
def test_a_straight_motion_keeps_the_held_joint(name):
    world = world_of(name)
    q = next(reaches(world, np.random.default_rng(2)))
    hand = arm_of(world.robot).hand_pose(q)
    up = np.repeat(hand[None], 12, axis=0)
    up[:, 2, 3] += np.linspace(0.0, 0.055, 12)
    found = straight_path(world, q, up, OPENING)
    assert found.found, found.reason
    assert np.ptp(found.q_rad[:, world.robot.held_index], axis=0).max() == 0.0
    assert np.abs(arm_of(world.robot).hand_pose(found.q_rad) - up).max() < 1e-8
