"""Scans of one object that lies differently in each come together, and give what no single one shows."""

from functools import cache

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.geometry import symmetries
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse, pose_difference
from handey_studio.modeling.aligning.align import align
from handey_studio.modeling.patches.finding import patches_of
from handey_studio.modeling.suggesting.report import aligned_box
from handey_studio.modeling.suggesting.suggest import suggest
from handey_studio.world import Library
from tests.localization.rendering import resting_poses
from tests.modeling.scenes import box_pose, boxes_seen, part_seen

L_BLOCK = Library.choose(None).part("l_block").solid


@cache
def looks():
    """The L-block flat on the table and standing on its end, as (T_world_part, scan, patches)."""
    rng, out = np.random.default_rng(3), []
    for pose, yaw in ((4, 0.4), (0, -1.1)):
        T = from_xyz_rpy((0.45, 0.01, 0.0), (0.0, 0.0, yaw)) @ resting_poses(L_BLOCK)[pose]
        scan = part_seen(L_BLOCK, T, rng)
        out.append((T, scan, patches_of(scan)))
    return out


def off(T_model_scan):
    """Distance [m] and angle [rad] from the true pose, whichever of the part's looks it took."""
    (T_a, _, _), (T_b, _, _) = looks()
    return min((pose_difference(T_model_scan @ T_b, T_a @ S) for S in symmetries(L_BLOCK)), key=sum)


@cache
def aligned():
    (_, a, in_a), (_, b, in_b) = looks()
    return align([a], [np.eye(4)], b, [in_a], in_b)


def test_figure_1s_l_block_comes_together_from_two_scans():
    found = aligned()
    assert found.T_model_scan is not None
    moved, turned = off(found.T_model_scan)
    assert moved < 0.001 and turned < np.deg2rad(0.7)
    assert len(found.residuals) >= 5 and found.rms < 0.0007
    assert not found.others


def test_both_scans_together_give_its_measures():
    (_, a, in_a), (_, b, in_b) = looks()
    T = aligned().T_model_scan
    assert T is not None
    found = suggest([a, b], [np.eye(4), T], patches=[in_a, in_b])
    assert found.solid is not None and len(found.solid.faces) == 8
    assert np.abs(aligned_box(found.solid) - aligned_box(L_BLOCK)).max() < 0.0005
    cosines = np.abs(found.solid.normals @ found.solid.normals.T)
    assert ((cosines < np.sin(np.deg2rad(0.3))) | (cosines > np.cos(np.deg2rad(0.3)))).all()
    assert {"seen in scan 1", "seen in scan 2"} <= set(found.sources)


def test_picked_points_say_which_pose():
    (T_a, a, in_a), (T_b, b, in_b) = looks()
    rng = np.random.default_rng(5)
    corners = L_BLOCK.vertices[[0, 3, 5, 8]]
    picked = [(apply(T_a, c) + rng.normal(0, 0.001, 3), apply(T_b, c) + rng.normal(0, 0.001, 3)) for c in corners]
    found = align([a], [np.eye(4)], b, [in_a], in_b, picked=picked)
    assert found.T_model_scan is not None
    moved, turned = pose_difference(found.T_model_scan, T_a @ inverse(T_b))
    assert moved < 0.002 and turned < np.deg2rad(1.0)


def test_degenerate_picks_are_refused():
    (_, a, in_a), (_, b, in_b) = looks()
    point = (np.zeros(3), np.zeros(3))
    with pytest.raises(BadInput, match="at least 3"):
        align([a], [np.eye(4)], b, [in_a], in_b, picked=[point, point])
    line = [(np.array([x, 0.0, 0.0]), np.array([x, 0.0, 0.0])) for x in (0.0, 0.1, 0.2)]
    with pytest.raises(BadInput, match="of a line"):
        align([a], [np.eye(4)], b, [in_a], in_b, picked=line)


def test_a_cuboid_cannot_tell_its_ends_apart():
    """A half turn of a cuboid shows the same: the other poses are told, with residuals as good."""
    size, rng = np.array([0.1, 0.07, 0.16]), np.random.default_rng(6)
    one = boxes_seen([(size, box_pose(size, -0.3))], rng, 0.0005)
    two = boxes_seen([(size, box_pose(size, -0.5, 0.02))], rng, 0.0005)
    found = align([one], [np.eye(4)], two)
    truths = [
        box_pose(size, -0.3) @ from_xyz_rpy((0, 0, 0), turn) @ inverse(box_pose(size, -0.5, 0.02)) for turn in ((0, 0, 0), (0, 0, np.pi))
    ]
    assert found.T_model_scan is not None and found.others
    best = min(pose_difference(found.T_model_scan, T) for T in truths)
    assert best[0] < 0.003 and best[1] < np.deg2rad(1.0)
    assert all(rms < 0.002 for _, rms in found.others)


def test_views_without_faces_tell_so():
    (_, a, in_a), _ = looks()
    empty = boxes_seen([], np.random.default_rng(8), 0.001)
    assert align([a], [np.eye(4)], empty, [in_a]).reason == "one of the scans shows no planar face"
