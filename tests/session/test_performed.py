"""What came of a plan, played over the cell's time."""

from dataclasses import replace

import numpy as np
import pytest

from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.session import PerformedReplay, attempts_of, replay_of, seconds_of
from handey_studio.task.acting.performance import Check, Incident
from handey_studio.world import Library, arm_of
from tests.session.samples import T_START, hand_made_performance, hand_made_plan, performed_session


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return Library(tmp_path_factory.mktemp("library")).robot("ur5")


@pytest.fixture(scope="module")
def replay(robot):
    plan = hand_made_plan(robot)
    return PerformedReplay(robot, plan, hand_made_performance(plan))


def test_the_time_is_the_cells_and_the_joints_are_those_measured(replay):
    assert replay.duration == pytest.approx(5 * 2.0 + 4 * 0.5)
    moment = replay.at(6.0)
    step = replay.plan.steps[2]
    expected = step.q_rad[0] + 0.5 * (step.q_rad[-1] - step.q_rad[0])
    np.testing.assert_allclose(moment.q_command_rad, expected, atol=1e-12)
    np.testing.assert_allclose(moment.q_rad, expected - 0.002, atol=1e-12)
    assert replay.traces.off_m.max() == pytest.approx(0.0, abs=0.006) and replay.traces.off_m.min() > 1e-4


def test_a_carried_part_hangs_in_the_hand_as_it_is_and_stays_where_it_was_let_go(replay):
    np.testing.assert_allclose(replay.at(1.0).T_world_part, T_START)
    carried = replay.at(6.0)
    assert carried.held == "l_block#1"
    hand = arm_of(replay.robot).hand_pose(carried.q_rad)
    np.testing.assert_allclose(carried.T_world_part, hand @ replay.plan.carries[0].grasp.T_hand_part)
    end = replay.at(replay.duration)
    assert end.held is None and replay.let_go(replay.duration) and not replay.let_go(6.0)
    assert 1e-5 < np.linalg.norm(end.T_world_part[:3, 3] - replay.plan.T_world_part_goal[:3, 3]) < 0.006


def test_what_the_scan_saw_counts_more_than_the_joints(replay):
    seen = from_xyz_rpy((0.1, 0.2, 0.3))
    checked = PerformedReplay(replay.robot, replay.plan, replace(replay.performance, check=Check("seen", "seen", seen, 0.1, 0.0)))
    np.testing.assert_allclose(checked.at(checked.duration).T_world_part, seen)
    np.testing.assert_allclose(checked.at(1.0).T_world_part, T_START)


def test_a_missed_part_stays_where_it_is_and_a_dropped_one_is_lost(robot):
    plan = hand_made_plan(robot)
    missed = PerformedReplay(robot, plan, hand_made_performance(plan, 2, Incident("missed", 1, "nothing between the fingers")))
    np.testing.assert_allclose(missed.at(missed.duration).T_world_part, T_START)
    assert not missed.at(missed.duration).lost
    dropped = PerformedReplay(robot, plan, hand_made_performance(plan, 3, Incident("dropped", 2, "the part fell")))
    assert dropped.at(6.0).held == "l_block#1" and dropped.at(dropped.duration).lost
    assert seconds_of(dropped, 2) == pytest.approx(dropped.duration) and seconds_of(dropped, -1) == 0.0


def test_attempts_are_told_in_order_each_with_its_own_plan(tmp_path, robot):
    result = performed_session(tmp_path).results[0]
    first, last = attempts_of(result)
    assert first.recovery is not None and last.recovery is None
    assert isinstance(replay_of(robot, first), PerformedReplay) and replay_of(robot, first).duration < replay_of(robot, last).duration


def test_clearance_is_that_of_the_plan_where_the_arm_was(replay):
    assert replay.clearance(6.0) == pytest.approx(0.02)
