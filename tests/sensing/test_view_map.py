"""The depth map of one camera's view: true heights where it saw, holes where it did not, and empty space only where light passed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from handey_studio.base import BadInput
from handey_studio.cell.recorded import read_depth_map, write_depth_map
from handey_studio.geometry.transforms import transform
from handey_studio.sensing.depth_map import SKY_M, DepthMap
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole
from handey_studio.sensing.view_map import depth_map_of
from tests.sensing.scenes import cast, looking_at, pile

PINHOLE = Pinhole(400.0, 400.0, 199.5, 149.5)


def seen(boxes, eye, noise=0.0, projection: Pinhole | Orthographic = PINHOLE, seed=0):
    T = looking_at(eye, (0.0, 0.0, 0.0))
    depth = cast(boxes, T, projection, (300, 400))
    rng = np.random.default_rng(seed)
    return DepthView(depth + rng.normal(0.0, noise, depth.shape), projection, T, max(noise, 0.0002), 0.002)


def truth(boxes, depth_map):
    """Heights (ny, nx) [m] of the scene straight below each cell's centre."""
    ny, nx = depth_map.elevation.shape
    above = Orthographic(depth_map.cell, -0.5, -0.5)
    T_range_above = transform(np.diag([1.0, -1.0, -1.0]), (0.0, ny * depth_map.cell, 1.0))
    return 1.0 - cast(boxes, depth_map.T_world_range @ T_range_above, above, (ny, nx))[::-1]


@pytest.mark.parametrize("eye", [(0.0, -0.05, 0.7), (0.1, -0.4, 0.6), (-0.5, 0.1, 0.5)])
def test_heights_are_the_scenes_and_holes_are_what_the_camera_did_not_see(eye):
    boxes = pile(np.random.default_rng(1), 6, 0.1, (0.02, 0.04))
    view = seen(boxes, eye)
    found = depth_map_of(view, 0.002, (-0.15, -0.15), (0.15, 0.15))
    true = truth(boxes, found)
    known = np.isfinite(found.elevation)
    off = np.abs(found.elevation - true)[known]
    assert np.quantile(off, 0.9) < 0.0005
    assert (found.elevation - ndimage.maximum_filter(true, 3))[known].max() < 0.004  # a reading counts for all of its cell
    assert known.mean() > 0.6


@pytest.mark.parametrize("eye", [(0.1, -0.4, 0.6), (-0.5, 0.1, 0.5)])
def test_space_is_empty_only_where_light_passed(eye):
    boxes = pile(np.random.default_rng(2), 6, 0.1, (0.02, 0.04))
    found = depth_map_of(seen(boxes, eye), 0.002, (-0.15, -0.15), (0.15, 0.15))
    true = truth(boxes, found)
    hole = np.isnan(found.elevation)
    assert hole.sum() > 200
    passed = hole & (found.passed < SKY_M)
    assert passed.sum() > 0.8 * hole.sum()
    assert np.quantile((found.passed - true)[passed], 0.01) > -0.003  # never through the scene
    assert np.array_equal(found.passed[~hole], found.elevation[~hole])


def test_a_cube_throws_the_shadow_that_its_height_and_the_sensors_make():
    cube = [(transform(translation=(0.0, 0.0, 0.025)), np.array([0.025, 0.025, 0.025]))]
    found = depth_map_of(seen(cube, (0.0, -0.5, 0.5)), 0.001, (-0.1, -0.1), (0.1, 0.15))
    column = found.elevation[:, 100]  # along y through the cube's middle; y of row j is (j + 0.5) mm − 0.1 m
    dark = np.nonzero(np.isnan(column))[0]
    reach = 0.025 + 0.05 * (0.5 + 0.025) / (0.5 - 0.05)  # where the line over the far upper edge comes down
    assert abs((dark.min() * 0.001 - 0.1) - 0.025) < 0.004 and abs((dark.max() * 0.001 - 0.1) - reach) < 0.004
    slope = found.passed[dark, 100]
    assert slope[2] > 0.04 and slope[-3] < 0.01 and np.all(np.diff(slope[2:-2]) < 0.001)


def test_the_map_of_a_maps_own_view_is_that_map():
    rng = np.random.default_rng(3)
    elevation = rng.uniform(0.0, 0.001, (60, 80))
    elevation[20:30, 10:40] += 0.03
    elevation[40:44, 50:60] = np.nan
    given = DepthMap(elevation, 0.002, transform(translation=(0.3, -0.2, 0.0)), np.nan_to_num(elevation, nan=SKY_M), 0.0003, 0.002)
    found = depth_map_of(given.view(), 0.002, (0.3, -0.2), (0.46, -0.08))
    assert found.elevation.shape == elevation.shape
    assert np.array_equal(np.isnan(found.elevation), np.isnan(elevation))
    assert np.nanmax(np.abs(found.elevation - elevation)) < 1e-6
    assert np.allclose(found.T_world_range, given.T_world_range)


def test_noise_stays_and_nothing_is_spanned_across_a_jump():
    boxes = [(transform(translation=(0.0, 0.0, 0.05)), np.array([0.04, 0.04, 0.05]))]
    found = depth_map_of(seen(boxes, (0.0, -0.3, 0.6), 0.0005), 0.0015)
    heights = found.elevation[np.isfinite(found.elevation)]
    between = (heights > 0.01) & (heights < 0.09)
    assert between.mean() < 0.03  # but for the side that the camera sees
    table = heights[np.abs(heights) < 0.005]
    assert 0.0003 < table.std() < 0.0006 and abs(np.median(table)) < 0.0001


def test_a_depth_file_serves_a_recorded_cell(tmp_path):
    found = depth_map_of(seen(pile(np.random.default_rng(4), 5), (0.1, -0.4, 0.6), 0.0005))
    assert 0.001 <= found.cell <= 0.004 and max(found.elevation.shape) <= 1024
    write_depth_map(tmp_path / "a.npz", found)
    assert read_depth_map(tmp_path / "a.npz") == found


def test_views_and_grids_that_make_no_map_are_told():
    view = seen([], (0.1, -0.4, 0.6))
    with pytest.raises(BadInput, match="0 readings within"):
        depth_map_of(replace(view, depth=np.full((300, 400), np.nan)))
    with pytest.raises(BadInput, match="no area"):
        depth_map_of(view, 0.002, (0.1, 0.1), (0.1, 0.2))
    with pytest.raises(BadInput, match="not usable"):
        depth_map_of(view, 0.00001)


@pytest.mark.parametrize("impossible", [np.inf, -np.inf, 0.0, -0.5])
def test_what_cannot_be_a_reading_is_none(impossible):
    depth = np.full((4, 6), 0.8)
    depth[1:3, 2:4] = impossible
    view = DepthView(depth, Pinhole(100.0, 100.0, 3.0, 2.0))
    assert np.isnan(view.depth[1:3, 2:4]).all() and np.isfinite(view.depth).sum() == 20


@pytest.mark.parametrize("shape", [(0, 0), (0, 5), (7,), (2, 2, 2)])
def test_an_image_without_pixels_is_refused_in_one_sentence(shape):
    with pytest.raises(BadInput, match="a depth image must be a table"):
        DepthView(np.zeros(shape), Pinhole(100.0, 100.0, 3.0, 2.0))
