"""What was known before a scan is taken up where the readings bear it out, and only there."""

from dataclasses import replace

import numpy as np
import pytest

from handey_studio.geometry.transforms import from_xyz_rpy, pose_difference, transform
from handey_studio.localization import LocatedPose, LocateResult, Rival
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.drawing import camera_of, rendered_depth
from handey_studio.task.remembering import known_after, remembered
from handey_studio.task.sense import Scene, name_instances
from handey_studio.world import Library, PlacedPart

L_BLOCK = Library.choose().part("l_block")
LOWER = from_xyz_rpy((0.15, 0.15, 0.0), (0.0, 0.0, 0.3))
UPPER = LOWER @ L_BLOCK.mates["block"].T_this_part
BESIDE = from_xyz_rpy((0.31, 0.2, 0.0), (0.0, 0.0, 1.1))


def seen(*poses: np.ndarray) -> DepthMap:
    """What a range finder with noise makes of L blocks on a table."""
    empty = DepthMap(np.zeros((160, 220)), 0.002, np.eye(4), np.zeros((160, 220)))
    view, heights = empty.view(), [np.zeros((160, 220))]
    for pose in poses:
        T = np.linalg.inv(view.T_world_sensor) @ pose
        corners = L_BLOCK.solid.vertices @ T[:3, :3].T + T[:3, 3]
        depth = rendered_depth(corners, L_BLOCK.solid.triangles, view.depth.shape, camera_of(view.projection))
        heights.append(np.nan_to_num(view.T_world_sensor[2, 3] - depth, nan=0.0)[::-1])
    elevation = np.max(heights, axis=0) + np.random.default_rng(0).normal(0.0, 0.0004, (160, 220))
    return DepthMap(elevation, 0.002, np.eye(4), elevation)


def scene(scan: DepthMap, *located: LocatedPose) -> Scene:
    return Scene(scan, LocateResult(tuple(located), (), (), ()), name_instances(tuple(located), (L_BLOCK,)))


def located(T: np.ndarray, *rivals: Rival) -> LocatedPose:
    return LocatedPose("l_block", T, T, 0.5, 9, 9, 1.0, 0.0, rivals=rivals)


def known(*poses: np.ndarray) -> tuple[PlacedPart, ...]:
    return tuple(PlacedPart(f"l_block#{k + 1}", L_BLOCK, T) for k, T in enumerate(poses))


def test_parts_that_nobody_recognises_are_taken_up_where_the_readings_lie_on_them():
    hidden = transform(None, (0.0, 0.0, -0.02)) @ BESIDE
    now = remembered(scene(seen(UPPER, LOWER, BESIDE)), known(UPPER, LOWER, hidden, BESIDE))
    assert [placed.name for placed in now.instances] == ["l_block#1", "l_block#2", "l_block#3"] == list(now.known)
    assert all(np.allclose(placed.T_world_part, T) for placed, T in zip(now.instances, (UPPER, LOWER, BESIDE), strict=True))
    uncovered = remembered(scene(seen(LOWER, BESIDE)), known(UPPER, LOWER))
    (lower,) = uncovered.instances
    assert np.allclose(lower.T_world_part, LOWER), "what lay over it is gone, and it shows again"


@pytest.mark.parametrize("by", [(0.004, 0.0, 0.004), (0.02, 0.0, 0.0), (0.0, 0.0, -0.006)])
def test_what_the_readings_do_not_bear_out_is_forgotten(by):
    before = scene(seen(UPPER, LOWER))
    assert remembered(before, known(transform(None, by) @ UPPER)) is before
    assert remembered(scene(seen()), known(UPPER, LOWER)).instances == ()


def test_a_found_part_is_not_found_twice_and_its_readings_are_its_own():
    before = scene(seen(BESIDE), located(BESIDE))
    assert remembered(before, known(transform(None, (0.001, 0.0, 0.0)) @ BESIDE)) is before
    assert remembered(before, known(transform(None, (0.008, 0.0, 0.0)) @ BESIDE)) is before


def test_of_two_readings_that_a_view_allows_the_known_one_is_taken_and_doubted_no_more():
    otherwise = BESIDE @ from_xyz_rpy((0.03, 0.01, 0.0), (0.0, 0.0, np.pi / 2))
    before = scene(seen(BESIDE), located(otherwise, Rival("l_block", BESIDE, 0.49)))
    assert before.doubts["l_block#1"] == pytest.approx(0.98)
    now = remembered(before, known(transform(None, (0.002, 0.001, 0.0)) @ BESIDE))
    assert now.known == ("l_block#1",) and "l_block#1" not in now.doubts
    assert pose_difference(now.instances[0].T_world_part, BESIDE)[0] < 1e-9, "as it is seen now, not as it was"


def test_what_a_move_leaves_known_is_everything_else_and_the_part_where_it_went():
    before = replace(scene(seen(LOWER, BESIDE)), instances=known(LOWER, BESIDE))
    after = known_after(before, "l_block#2", UPPER)
    assert [placed.name for placed in after] == ["l_block#1", "l_block#2"] and np.allclose(after[1].T_world_part, UPPER)
    assert [placed.name for placed in known_after(before, "l_block#2", None)] == ["l_block#1"]
