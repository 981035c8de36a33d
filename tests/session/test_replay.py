"""A plan played over time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.session import Replay
from handey_studio.world import Library, arm_of
from tests.session.samples import T_START, hand_made_plan


@pytest.fixture(scope="module")
def replay(tmp_path_factory):
    robot = Library(tmp_path_factory.mktemp("library")).robot("ur5")
    return Replay(robot, hand_made_plan(robot))


def test_the_part_rests_is_carried_and_rests_again(replay):
    np.testing.assert_allclose(replay.at(0.0).T_world_part, T_START)
    carried = replay.at(5.0)
    assert carried.held == "l_block#1" and replay.plan.steps[carried.step].kind == "transfer"
    hand = arm_of(replay.robot).hand_pose(carried.q_rad)
    np.testing.assert_allclose(carried.T_world_part, hand @ replay.plan.steps[2].T_hand_part)
    np.testing.assert_allclose(replay.at(replay.duration).T_world_part, replay.plan.T_world_part_goal, atol=1e-12)


@given(st.floats(-5, 15), st.floats(1e-6, 1e-3))
@settings(max_examples=100, deadline=None)
def test_nothing_jumps(replay, time_s, later):
    a, b = replay.at(time_s), replay.at(time_s + later)
    assert np.abs(a.q_rad - b.q_rad).max() < 2.0 * later + 1e-9
    assert abs(a.hand_opening_m - b.hand_opening_m) < 0.1 * later + 1e-9
    assert np.abs(a.T_world_part - b.T_world_part).max() < 5.0 * later + 1e-9


def test_steps_cover_the_whole_time(replay):
    assert replay.starts == pytest.approx((0, 2, 4, 6, 8, 10)) and replay.duration == pytest.approx(10)
    assert [replay.step_at(t) for t in (-1, 0, 1.999, 2.0, 9.99, 10, 99)] == [0, 0, 0, 1, 4, 4, 4]


def test_the_hand_path_is_where_the_hand_goes(replay):
    path = replay.hand_path(101)
    np.testing.assert_allclose(path[50], arm_of(replay.robot).hand_pose(replay.at(5.0).q_rad)[:3, 3])
