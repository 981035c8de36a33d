"""What a nearer thing hides of a symmetric face is proposed by its mirror image, and only then."""

import numpy as np

from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.modeling.patches.finding import patches_of
from handey_studio.modeling.suggesting.mirrored import mirrored
from handey_studio.modeling.suggesting.outlines import Line, corners_of
from handey_studio.modeling.suggesting.report import aligned_box
from handey_studio.modeling.suggesting.suggest import suggest_object
from handey_studio.sensing.depth_view import Pinhole
from handey_studio.world import Library
from tests.localization.rendering import resting_poses
from tests.modeling.looks import looking, moved, scan_of

T_BLOCK = Library.choose(None).part("t_block").solid
T_SHAPE = [(0, 0), (90, 0), (90, 30), (60, 30), (60, 60), (30, 60), (30, 30), (0, 30)]


def outline(corners, cut=()) -> list[Line]:
    """The sides of a polygon [mm], counter-clockwise; those numbered in `cut` go on behind something."""
    lines, points = [], 0.001 * np.array(corners, dtype=float)
    for k, (start, end) in enumerate(zip(points, np.roll(points, -1, axis=0), strict=True)):
        length = float(np.linalg.norm(end - start))
        outward = np.array([end[1] - start[1], start[0] - end[0]]) / length
        lines.append(Line(outward, float(outward @ start), length, 0.0, k in cut))
    return lines


def same(lines, corners) -> bool:
    """Whether lines meet in the corners [mm], in any order."""
    met = corners_of(lines)
    return met is not None and sorted(np.round(1e3 * met + 0.0, 6).tolist()) == sorted([float(x), float(y)] for x, y in corners)


def test_an_arm_that_is_cut_off_gets_the_other_ones_length():
    half = [(0, 0), (72, 0), (78, 30), (60, 30), (60, 60), (30, 60), (30, 30), (0, 30)]
    assert any(same(lines, T_SHAPE) for lines in mirrored(outline(half, cut=(1,)), 0.002))


def test_nothing_is_completed_where_the_hidden_end_is_its_own_mirror_image():
    assert not list(mirrored(outline([(0, 0), (70, 0), (70, 30), (0, 30)], cut=(1,)), 0.002))


def test_nothing_is_completed_against_what_is_seen():
    """The other arm is seen to end sooner: no axis of the stem maps it onto the cut one without growing it."""
    short = [(10, 0), (95, 0), (95, 30), (60, 30), (60, 60), (30, 60), (30, 30), (10, 30)]
    assert not list(mirrored(outline(short, cut=(1,)), 0.002))


def test_a_t_behind_a_post_is_closed_by_its_symmetry():
    solid = moved(T_BLOCK, from_xyz_rpy((0, 0, 0), (0, 0, 0.6)) @ resting_poses(T_BLOCK)[2])
    post = moved(box((0.03, 0.02, 0.10)), from_xyz_rpy((0.035, -0.07, 0.05)))
    scan = scan_of([solid, post], looking((0.0, -0.45, 0.40), (0, 0, 0)), Pinhole(600.0, 600.0, 319.5, 239.5), 0.0005, shape=(480, 640))
    patches = patches_of(scan)
    nearest = min(patches.patches, key=lambda patch: float(np.linalg.norm(patch.rings[0].mean(axis=0)[:2])))
    assert any(border.kind == "cut" for border in nearest.borders[0])
    found = suggest_object([scan], [np.eye(4)], [patches], 0, nearest.object)
    assert found.solid is not None and len(found.solid.faces) == 10
    assert np.abs(aligned_box(found.solid) - aligned_box(T_BLOCK)).max() < 0.001
    assert "assumed: symmetric" in found.sources and "assumed: support" in found.sources
