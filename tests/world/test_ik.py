"""Inverse kinematics of every bundled arm: configurations that made a pose are found again, singular ones and all branches included."""

from dataclasses import replace

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.world import Library, arm_of
from handey_studio.world.ik_newton import FAR_ROUNDS, from_starts
from handey_studio.world.screws import flange, jacobian

LIBRARY = Library.choose()
NAMES = ("panda", "puma560", "ur10", "ur3", "ur5", "xarm7")


def arm(name):
    return arm_of(LIBRARY.robot(name))


def turned_by(branches, q):
    """How far (k,) [rad] branches are from a configuration, whole turns aside."""
    return np.abs(np.mod(branches - q + np.pi, 2 * np.pi) - np.pi).max(axis=1)


def postures(robot, rng, count):
    """Within the limits, every third one close to where joints line up."""
    q = rng.uniform(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi), (count, len(robot.lower)))
    close = np.clip(rng.choice([0.0, np.pi / 2, -np.pi / 2], q.shape) + rng.choice([1e-2, -1e-3, 3e-4], q.shape), robot.lower, robot.upper)
    return np.where((np.arange(count) % 3 == 0)[:, None] & (rng.random(q.shape) < 0.5), close, q)


@pytest.mark.parametrize("name", NAMES)
def test_the_configuration_that_made_a_pose_is_among_the_branches(name):
    mine, rng = arm(name), np.random.default_rng(1)
    for q in postures(mine.robot, rng, 150):
        T = mine.hand_pose(q)
        branches = mine.ik(T, q[mine.robot.held_index])
        assert np.abs(mine.hand_pose(branches) - T).max() < 1e-8
        free = np.setdiff1d(np.arange(mine.n), mine.robot.held_index)
        blunt = np.linalg.svd(jacobian(mine.screws, q, tuple(T[:3, 3]))[:, free])[1][-1]
        assert turned_by(branches, q).min() < 1e-6 / max(blunt, 1e-3), (q, blunt)
        apart = [turned_by(np.delete(branches, k, axis=0), branch).min(initial=1.0) for k, branch in enumerate(branches)]
        assert min(apart) > 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_a_stretched_and_a_singular_arm_still_reach_their_pose(name):
    mine, rng = arm(name), np.random.default_rng(2)
    robot = mine.robot
    for _ in range(60):
        q = rng.uniform(robot.lower, robot.upper)
        q[rng.integers(1, mine.n)] = 0.0
        q[robot.wrist_index[1]] = 0.0
        T = mine.hand_pose(q)
        branches = mine.ik(T, q[robot.held_index])
        assert len(branches) and np.abs(mine.hand_pose(branches) - T).max() < 1e-7


@pytest.mark.parametrize("name", NAMES)
def test_a_search_from_many_starts_finds_no_branch_more(name):
    mine, rng = arm(name), np.random.default_rng(3)
    robot, found, all_told = mine.robot, 0, 0
    free = np.setdiff1d(np.arange(mine.n), robot.held_index)
    for q in rng.uniform(robot.lower, robot.upper, (6, mine.n)):
        starts = rng.uniform(-np.pi, np.pi, (400, mine.n))
        starts[:, robot.held_index] = q[robot.held_index]
        T = flange(mine.screws, q)
        branches = mine.ik(mine.hand_pose(q), q[robot.held_index])
        searched = from_starts(mine.screws, T, starts, free, FAR_ROUNDS)
        assert len(searched) > 40
        found += sum(turned_by(branches, other).min() < 1e-5 for other in searched)
        all_told += len(searched)
    assert found == all_told


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_arms_of_no_known_layout_are_solved_from_many_starts(name):
    closed, rng = arm(name), np.random.default_rng(4)
    open_ = arm_of(replace(closed.robot, ik="numeric"))
    found = wanted = 0
    for q in rng.uniform(np.maximum(closed.robot.lower, -np.pi), np.minimum(closed.robot.upper, np.pi), (12, closed.n)):
        T, held = closed.hand_pose(q), q[closed.robot.held_index]
        branches = open_.ik(T, held)
        assert np.abs(open_.hand_pose(branches) - T).max() < 1e-8
        inside = [b for b in closed.ik(T, held) if closed.robot.limit_margin(closed.nearest_turns(b, closed.robot.home)) > 0]
        found += sum(turned_by(branches, b).min() < 1e-5 for b in inside)
        wanted += len(inside)
    assert found >= 0.99 * wanted


@pytest.mark.parametrize("name", ["panda", "xarm7"])
def test_held_joints_are_tried_at_each_of_their_values(name):
    mine = arm(name)
    q = mine.robot.home.copy()
    branches = mine.ik(mine.hand_pose(q))
    held = branches[:, mine.robot.held_index[0]]
    assert set(held) <= set(mine.robot.held_values[:, 0]) and len(set(held)) >= 3
    assert turned_by(branches, q).min() < 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_out_of_reach_is_no_branch(name):
    T = np.eye(4)
    T[:3, 3] = (3.0, 0.0, 0.0)
    assert arm(name).ik(T).shape == (0, arm(name).n)


@pytest.mark.parametrize(
    ("name", "solver", "says"),
    [
        ("puma560", "ur", "needs axes 3 and 4 parallel"),
        ("ur5", "spherical_wrist", "needs axes 4 and 5 and 6 to meet in a point"),
        ("panda", "ur", "needs 6 joints, it has 7"),
        ("ur5", "seven", "needs 7 joints of which the third is held"),
        ("ur5", "best", "choose one of"),
    ],
)
def test_a_solver_that_does_not_suit_the_arm_says_why(name, solver, says):
    with pytest.raises(BadInput, match=says):
        arm_of(replace(arm(name).robot, ik=solver)).ik(np.eye(4))
