"""Where silhouettes lie: sensors lose readings at rims in their own ways, and what is measured does not grow or shrink by it."""

import numpy as np
import pytest

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.stripes import photograph
from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.modeling.patches.sides import drift_of
from handey_studio.modeling.scans import Scan, scan_of_map
from handey_studio.modeling.suggesting.report import aligned_box
from handey_studio.modeling.suggesting.suggest import suggest
from handey_studio.sensing.depth_view import DepthView
from handey_studio.sensing.stripes.fusing import rim_of
from handey_studio.sensing.stripes.range_finder import RangeFinder
from tests.modeling.scenes import box_pose, boxes_seen

SIZE = np.array([0.10, 0.07, 0.16])


def straight(off) -> np.ndarray:
    """A rim of pixels along a row whose places across it are `off` (n,)."""
    return np.stack([np.arange(len(off), dtype=float), off], axis=1)


def test_chance_is_no_drift_and_what_neighbours_share_is():
    rng = np.random.default_rng(1)
    chance = [straight(-rng.integers(0, 2, 60).astype(float)) for _ in range(30)]
    assert drift_of(chance) < 0.1
    shared = [straight(0.8 * np.convolve(rng.normal(0.0, 1.0, 68), np.ones(9) / 3.0, "valid")) for _ in range(30)]
    assert 0.3 < drift_of(shared) < 0.8
    assert drift_of([]) == 0.0 and drift_of([straight(np.zeros(5))]) == 0.0


@pytest.mark.parametrize("chance", [0.0, 0.5])
def test_readings_lost_by_chance_at_rims_leave_a_box_its_size(chance):
    """Each outermost pixel lost with a chance: the rim is where the outermost that are left end, not their mean."""
    rng, errors = np.random.default_rng(2), []
    for _ in range(3):
        scan = boxes_seen([(SIZE, box_pose(SIZE, rng.uniform(-3, 3)))], rng, 0.0005)
        depth = np.array(scan.view.depth)
        around = np.max([np.roll(depth, step, axis) for axis in (0, 1) for step in (-1, 1)], axis=0)
        depth[(around - depth > 0.01) & (rng.random(depth.shape) < chance)] = np.nan
        found = suggest([Scan("camera", DepthView(depth, scan.view.projection, scan.view.T_world_sensor, 0.0005, 0.003))])
        assert found.solid is not None
        errors.append(aligned_box(found.solid) - np.sort(SIZE))
    assert np.abs(errors).max() < 0.0008 and np.abs(np.mean(errors, axis=0)).max() < 0.0005


def test_the_range_finder_does_not_widen_a_bar():
    """In its cells the highest surface wins, so outlines reach into cells that they hardly cover."""
    rng, errors = np.random.default_rng(3), []
    size = np.array([0.08, 0.03, 0.02])
    table = SolidBody("table", box((0.8, 0.8, 0.1)), from_xyz_rpy((0.48, 0.0, -0.05)), fixed=True)
    for yaw in (0.6, 2.9):
        bar = SolidBody("bar", box(size), from_xyz_rpy((0.48, 0.01, 0.01), (0.0, 0.0, yaw)))
        found = suggest([scan_of_map("bar", photograph(RangeFinder(), [table, bar], rng))])
        assert found.solid is not None
        errors.append(aligned_box(found.solid) - np.sort(size))
    width = np.array(errors)[:, 1]
    assert np.abs(errors).max() < 0.00045 and np.abs(width).max() < 0.00025
    assert rim_of(1.0) == 0.5 and rim_of(4.0) == 0.25 and rim_of(0.0) == 0.5
