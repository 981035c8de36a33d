import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import from_xyz_rpy, pose_difference
from handey_studio.task.destination import Area, FixedPose, MatingPose, format_pose, goal_poses, parse_destination
from handey_studio.world import Library, PlacedPart

PARTS = {name: Library.choose().part(name) for name in ("l_block", "brick")}


def test_positions_are_metres_and_angles_degrees():
    goal = parse_destination("0.4,-0.1,0.02,0,0,90", "brick", PARTS)
    assert isinstance(goal, FixedPose)
    assert np.allclose(goal.T_world_part, from_xyz_rpy((0.4, -0.1, 0.02), (0, 0, np.pi / 2)))
    short = parse_destination("0.4,-0.1,0.02", "brick", PARTS)
    assert isinstance(short, FixedPose) and np.allclose(short.T_world_part[:3, :3], np.eye(3))


@given(st.tuples(*[st.floats(-1, 1)] * 3), st.tuples(st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3)))
def test_a_pose_survives_being_typed(xyz, rpy):
    T = from_xyz_rpy(xyz, rpy)
    again = parse_destination(format_pose(T), "brick", PARTS)
    assert isinstance(again, FixedPose)
    metres, radians = pose_difference(T, again.T_world_part)
    assert metres < 2e-5 and radians < 1e-4


def test_the_only_mating_pose_need_not_be_named():
    assert parse_destination("on:l_block", "l_block#2", PARTS) == MatingPose("l_block", "block")
    assert parse_destination("on:l_block#1:block", "l_block", PARTS) == MatingPose("l_block#1", "block")


def test_a_mating_pose_means_every_other_instance():
    one = PlacedPart("l_block#1", PARTS["l_block"], from_xyz_rpy((0.4, 0, 0), (np.pi / 2, 0, 0)))
    two = PlacedPart("l_block#2", PARTS["l_block"], from_xyz_rpy((0.5, 0.1, 0), (np.pi / 2, 0, 0)))
    goals = goal_poses(MatingPose("l_block", "block"), "l_block#1", PARTS, (one, two))
    assert [label for label, _ in goals] == ["on l_block#2:block"]
    assert np.allclose(goals[0][1], two.T_world_part @ PARTS["l_block"].mates["block"].T_this_part)
    assert goal_poses(MatingPose("l_block", "block"), "l_block#1", PARTS, (one,)) == []


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is not understood"),
        ("0.1,0.2", "has 2 numbers"),
        ("0.1,0.2,nan", "finite"),
        ("400,20,0", "metres"),
        ("a,b,c", "is not understood"),
        ("on:nothing", 'part "nothing" is not known; choose one of: brick, l_block'),
        ("on:l_block:side", "choose one of: block"),
        ("on:brick", "has 0 mating poses"),
        ("<script>", "is not understood"),
    ],
)
def test_what_is_not_a_destination_is_told_in_a_sentence(text, says):
    with pytest.raises(BadInput, match=says) as caught:
        parse_destination(text, "l_block", PARTS)
    assert "\n" not in str(caught.value)


def test_an_area_is_a_rectangle_whichever_corners_are_given():
    assert parse_destination("in:0.6,-0.2,0.3,0.1", "l_block", PARTS) == Area((0.3, -0.2), (0.6, 0.1))


@pytest.mark.parametrize("text", ["in:", "in:1,2,3", "in:a,b,c,d", "in:0,0,0,1", "in:0,0,nan,1", "in:0,0,600,400"])
def test_what_is_no_area_is_refused_in_one_sentence(text):
    with pytest.raises(BadInput, match="area") as refused:
        parse_destination(text, "l_block", PARTS)
    assert "\n" not in str(refused.value)
