"""Planar faces found again in views whose faces are known, and no trouble with views that have none."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.modeling.patches.finding import patch_at, patches_of
from handey_studio.modeling.scans import Scan, scan_of_view
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole
from tests.modeling.scenes import PINHOLE, box_pose, boxes_seen

SIZE = np.array([0.10, 0.07, 0.16])


@pytest.fixture(scope="module")
def carton():
    scan = boxes_seen([(SIZE, box_pose(SIZE, -0.3))], np.random.default_rng(1), 0.0006, lost=0.01)
    return scan, patches_of(scan)


def test_the_three_faces_of_a_box_are_found_as_one_body(carton):
    _, patches = carton
    assert [len(group) for group in patches.objects] == [3]
    T = box_pose(SIZE, -0.3)
    for patch in patches.patches:
        cosines = T[:3, :3].T @ patch.normal
        axis = int(np.argmax(np.abs(cosines)))
        assert abs(cosines[axis]) > np.cos(np.deg2rad(0.7))
        true = 0.5 * SIZE[axis] + np.sign(cosines[axis]) * T[:3, axis] @ T[:3, 3]
        assert abs(patch.offset - true) < 0.0008


def test_the_planes_hold_at_the_noise_of_a_depth_camera():
    patches = patches_of(boxes_seen([(SIZE, box_pose(SIZE, -0.3))], np.random.default_rng(5), 0.0015, lost=0.02))
    assert [len(group) for group in patches.objects] == [3]
    top = max(patches.patches, key=lambda patch: patch.normal[2])
    assert abs(top.offset - SIZE[2]) < 0.0005 and top.normal[2] > np.cos(np.deg2rad(0.5))


def test_outlines_have_the_faces_corners(carton):
    _, patches = carton
    T = box_pose(SIZE, -0.3)
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * SIZE @ T[:3, :3].T + T[:3, 3]
    for patch in patches.patches:
        assert len(patch.rings) == 1 and len(patch.rings[0]) == 4
        for corner in patch.rings[0]:
            assert np.linalg.norm(corners - corner, axis=1).min() < 0.004


def test_sides_tell_what_lies_beyond(carton):
    _, patches = carton
    top = max(patches.patches, key=lambda patch: patch.normal[2])
    assert sorted(border.kind for border in top.borders[0]) == ["crease", "crease", "rim", "rim"]
    for patch in patches.patches:
        if patch is not top:
            assert sorted(border.kind for border in patch.borders[0]) == ["crease", "crease", "foot", "rim"]


def test_outlines_run_counter_clockwise_seen_from_outside(carton):
    for patch in carton[1].patches:
        ring = patch.rings[0]
        assert np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0) @ patch.normal > 0


def test_a_click_finds_the_face_below_it(carton):
    scan, patches = carton
    for patch in patches.patches:
        rows, columns = np.nonzero(patches.labels == patch.number)
        middle = int(np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2))
        assert patch_at(patches, float(columns[middle]), float(rows[middle])) is patch
    assert patch_at(patches, 3.0, 3.0) is None and patch_at(patches, -50.0, 9999.0) is None
    assert scan.view.depth.shape == patches.labels.shape


def test_a_nearer_box_cuts_off_the_one_behind_and_is_another_body():
    small = np.array([0.06, 0.06, 0.10])
    boxes = [(SIZE, box_pose(SIZE, 0.3, 0.0, 0.1)), (small, box_pose(small, 0.2, 0.03, -0.05))]
    patches = patches_of(boxes_seen(boxes, np.random.default_rng(2), 0.001))
    assert len(patches.objects) == 2
    behind = [patch for patch in patches.patches if patch.object == patches.patches[patches.objects[0][0]].object]
    assert any(border.kind == "cut" for patch in behind for border in patch.borders[0])


def test_a_box_on_another_is_another_body():
    under, over = np.array([0.2, 0.15, 0.05]), np.array([0.07, 0.06, 0.09])
    boxes = [(under, box_pose(under, 0.2)), (over, box_pose(over, 0.7, 0.02, 0.0, 0.05))]
    patches = patches_of(boxes_seen(boxes, np.random.default_rng(3), 0.001))
    assert len(patches.objects) == 2
    tops = [patch for patch in patches.patches if patch.normal[2] > 0.99]
    assert sorted(round(patch.offset, 3) for patch in tops) == [0.05, 0.14] and tops[0].object != tops[1].object
    assert any(not crease.convex for crease in patches.creases)


def odd_views():
    rng = np.random.default_rng(4)
    v, u = np.mgrid[:120, :160]
    ball = np.where(
        (u - 80) ** 2 + (v - 60) ** 2 < 40**2, 0.6 - 0.05 * np.sqrt(np.maximum(0, 1 - ((u - 80) ** 2 + (v - 60) ** 2) / 1600)), 0.65
    )
    return {
        "nothing": np.full((120, 160), np.nan),
        "one pixel": np.array([[0.6]]),
        "one reading": np.where((u == 80) & (v == 60), 0.5, np.nan),
        "a row": np.full((1, 200), 0.6),
        "a plane that fills the view": np.full((120, 160), 0.5),
        "chance": rng.uniform(0.2, 2.0, (120, 160)),
        "a ball": ball,
        "a checkerboard": np.where((u + v) % 2 == 0, 0.6, np.nan),
    }


@pytest.mark.parametrize("name", list(odd_views()))
@pytest.mark.parametrize("projection", [Pinhole(150.0, 150.0, 80.0, 60.0), Orthographic(0.001, 80.0, 60.0)])
def test_odd_views_give_patches_or_none(name, projection):
    depth = odd_views()[name]
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[2, 3] = 0.65
    patches = patches_of(Scan("odd", DepthView(depth, projection, T, 0.001, 0.002)))
    assert patches.labels.shape == depth.shape
    assert sorted(k for group in patches.objects for k in group) == list(range(len(patches.patches)))


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 1.0), st.floats(0.0, 0.01))
def test_readings_lost_anywhere_never_break_it(seed, lost, noise):
    rng = np.random.default_rng(seed)
    scan = boxes_seen([(SIZE, box_pose(SIZE, rng.uniform(-3, 3)))], rng, noise=noise + 1e-5, lost=lost)
    small = replace(scan.view, depth=scan.view.depth[120:360:2, 200:440:2], projection=Pinhole(262.5, 262.5, 59.75, 59.75))
    patches = patches_of(Scan("small", small))
    for patch in patches.patches:
        assert np.isfinite(patch.rings[0]).all() and patch.area > 0


def test_a_view_without_a_support_is_refused():
    with pytest.raises(BadInput, match="shows no support"):
        scan_of_view("empty", DepthView(np.full((100, 100), np.nan), PINHOLE), "test")
