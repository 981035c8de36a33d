"""Closed solids suggested for objects whose shape is known and hidden from the program."""

import numpy as np
import pytest

from handey_studio.geometry import prism
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.modeling.patches.finding import patches_of
from handey_studio.modeling.patches.growing import _grow
from handey_studio.modeling.patches.windows import _window_planes
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.suggesting.fit import first_hits
from handey_studio.modeling.suggesting.report import aligned_box
from handey_studio.modeling.suggesting.suggest import suggest, suggest_object
from handey_studio.modeling.suggesting.warm_up import warm_up
from handey_studio.sensing.depth_view import DepthView
from handey_studio.world import Library
from tests.localization.rendering import resting_poses
from tests.modeling.scenes import PINHOLE, box_pose, boxes_seen, part_seen

LIBRARY = Library.choose(None)
MIDDLE = (0.45, 0.0, 0.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_carton_is_closed_from_one_view(seed):
    rng = np.random.default_rng(seed)
    size = rng.uniform([0.05, 0.06, 0.05], [0.09, 0.15, 0.2])
    found = suggest([boxes_seen([(size, box_pose(size, rng.uniform(-3, 3)))], rng, 0.0015, lost=0.01)])
    assert found.solid is not None and len(found.solid.faces) == 6
    assert np.abs(aligned_box(found.solid) - np.sort(size)).max() < 0.004
    assert abs(found.solid.vertices[:, 2].max() - size[2]) < 0.001 and abs(found.solid.vertices[:, 2].min()) < 1e-9
    assert found.explained > 0.98 and found.rms < 0.002
    assert found.sources.count("assumed: support") == 1 and 2 <= sum(s == "seen in scan 1" for s in found.sources) <= 3


@pytest.mark.parametrize(("part", "pose"), [("l_block", 4), ("l_block", 1), ("stairs", 0), ("wedge", 3)])
def test_a_part_seen_from_above_is_closed(part, pose):
    """Lying flat it is a prism under its top; as a step or a slope, columns under its upward faces."""
    solid, rng = LIBRARY.part(part).solid, np.random.default_rng(7)
    found = suggest([part_seen(solid, from_xyz_rpy(MIDDLE, (0, 0, rng.uniform(-3, 3))) @ resting_poses(solid)[pose], rng)])
    assert found.solid is not None and len(found.solid.faces) == len(solid.faces)
    assert np.abs(aligned_box(found.solid) - aligned_box(solid)).max() < 0.0007
    assert abs(found.solid.volume_and_centroid[0] / solid.volume_and_centroid[0] - 1.0) < 0.02
    for f, normal in enumerate(found.solid.normals):
        square = np.abs(found.solid.normals @ normal)
        assert part == "wedge" or ((square < 1e-6) | (square > 1 - 1e-6)).all(), f


def test_every_candidate_that_fell_tells_why():
    solid, rng = LIBRARY.part("l_block").solid, np.random.default_rng(8)
    found = suggest([part_seen(solid, from_xyz_rpy(MIDDLE) @ resting_poses(solid)[4], rng)])
    assert sum(entry.reason is None for entry in found.entries) >= 1
    fell = [entry for entry in found.entries if entry.reason is not None]
    told = {entry.reason: (entry.value or 0.0, entry.limit or 0.0) for entry in fell}
    assert told and set(told) <= {"too few of the object's readings lie on it", "the sensor saw through it"}
    assert all((value < limit) == reason.startswith("too few") for reason, (value, limit) in told.items() if reason is not None)


def test_what_a_nearer_thing_hides_is_not_made_up():
    """Nothing shows how wide the box behind is: its side is behind the one in front."""
    wide, near = np.array([0.24, 0.05, 0.12]), np.array([0.10, 0.06, 0.2])
    boxes = [(wide, box_pose(wide, 0.0, 0.0, 0.15)), (near, box_pose(near, 0.0, 0.1, -0.02))]
    scan = boxes_seen(boxes, np.random.default_rng(9), 0.0008, eye=np.array([0.1, -0.8, 0.3]))
    patches = patches_of(scan)
    for number, group in enumerate(patches.objects):
        found = suggest_object([scan], [np.eye(4)], [patches], 0, number)
        middle = np.mean([patches.patches[k].rings[0].mean(axis=0) for k in group], axis=0)
        if middle[1] > 0.08:
            assert found.solid is not None or found.reason
            assert found.solid is None or abs(aligned_box(found.solid)[2] - 0.24) < 0.006


def test_the_upper_of_two_stacked_boxes_ends_on_the_lower():
    under, over = np.array([0.2, 0.15, 0.05]), np.array([0.07, 0.06, 0.09])
    boxes = [(under, box_pose(under, 0.2)), (over, box_pose(over, -0.4, 0.02, 0.0, 0.05))]
    scan = boxes_seen(boxes, np.random.default_rng(10), 0.001)
    patches = patches_of(scan)
    top = max(patches.patches, key=lambda patch: patch.offset * (patch.normal[2] > 0.99))
    found = suggest_object([scan], [np.eye(4)], [patches], 0, top.object)
    assert found.solid is not None
    assert np.abs(aligned_box(found.solid) - np.sort(over)).max() < 0.004
    assert abs(found.solid.vertices[:, 2].min() - 0.05) < 0.001


def test_nothing_there_tells_so():
    table = boxes_seen([], np.random.default_rng(11), 0.001)
    assert suggest([table]).solid is None and "nothing with a planar face" in suggest([table]).reason
    empty = Scan("empty", DepthView(np.full((60, 80), np.nan), PINHOLE))
    assert suggest([empty]).solid is None
    assert "at 5, 5 px" in suggest([table], at=(0, 5.0, 5.0)).reason


def test_first_hits_are_those_of_slabs():
    """Rays against a box's triangles, and in closed form."""
    rng = np.random.default_rng(12)
    solid = prism([[0, 0], [0.3, 0], [0.3, 0.2], [0, 0.2]], 0.1)
    starts = rng.uniform(-0.5, 0.8, (2000, 3))
    steps = rng.normal(size=(2000, 3))
    depth, which = first_hits(np.ascontiguousarray(solid.vertices[solid.triangles]), starts, steps)
    low, high = -starts / steps, (np.array([0.3, 0.2, 0.1]) - starts) / steps
    enter, leave = np.minimum(low, high).max(axis=1), np.maximum(low, high).min(axis=1)
    first = np.where(enter > 0, enter, leave)
    hit = (enter <= leave) & (first > 0)
    assert ((which >= 0) == hit).all() and hit.sum() > 20
    assert np.allclose(depth[hit], first[hit])


def test_warming_up_reaches_what_is_compiled():
    warm_up()
    assert first_hits.signatures and _grow.signatures and _window_planes.signatures
