"""The range finder as an instrument: triangulation and fusing, on readings whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse
from handey_studio.sensing.stripes.range_finder import RangeFinder, camera_looking_at, fuse, triangulate

FINDER = RangeFinder()
CELL = FINDER.cell


def patch(x0: float, x1: float, y0: float, y1: float, z: float, step: float = 0.0005) -> np.ndarray:
    """Readings on a level patch, away from cell borders."""
    x, y = np.meshgrid(np.arange(x0 + step / 2, x1, step), np.arange(y0 + step / 2, y1, step))
    return np.stack([x, y, np.full_like(x, z)], axis=-1).reshape(-1, 3)


@given(
    plane=st.integers(0, FINDER.planes - 1),
    camera=st.integers(0, 1),
    y=st.floats(0.0, 0.4),
    z=st.floats(0.0, 0.25),
)
def test_a_point_on_a_laser_plane_is_triangulated_back_from_its_peak(plane, camera, y, z):
    angle = FINDER.plane_angles[plane]
    point = np.array([FINDER.laser[0] + (FINDER.laser[2] - z) * np.tan(angle), y, z])
    view = FINDER.cameras[camera]
    u, v = view.projection.project(apply(inverse(view.T_range_camera), point))
    found = triangulate(FINDER, camera, np.array([u]), np.array([v]), np.array([plane]))
    assert np.allclose(found[0], point, atol=1e-9)


def test_a_peak_that_is_off_moves_the_height_as_the_noise_model_says():
    middle = np.array([0.2, 0.2, 0.0])
    view = FINDER.cameras[0]
    u, v = view.projection.project(apply(inverse(view.T_range_camera), middle))
    plane = np.argmin(np.abs(FINDER.plane_angles))
    heights = [triangulate(FINDER, 0, np.array([u + off]), np.array([v]), np.array([plane]))[0, 2] for off in (0, FINDER.peak_noise_px)]
    assert abs(heights[1] - heights[0]) == pytest.approx(FINDER.reading_noise, rel=0.15)


def test_both_cameras_see_the_whole_area_up_to_a_quarter_metre():
    corners = np.array([[x, y, z] for x in (0, 0.4) for y in (0, 0.4) for z in (0, 0.25)])
    for view in FINDER.cameras:
        u, v = view.projection.project(apply(inverse(view.T_range_camera), corners)).T
        assert (u > 0).all() and (u < view.width - 1).all() and (v > 0).all() and (v < view.height - 1).all()


def test_camera_axes_are_right_down_forward():
    T = camera_looking_at((0.0, 0.2, 1.0), (0.2, 0.2, 0.0)).T_range_camera
    assert T[0, 0] > 0 and np.allclose(T[:3, 1], (0, -1, 0)) and T[2, 2] < 0
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)


def test_the_highest_surface_wins_and_its_readings_are_averaged():
    noise = np.random.default_rng(1).normal(0.0, FINDER.reading_noise, 1600)
    low = patch(0.1, 0.12, 0.1, 0.12, 0.0)
    high = patch(0.11, 0.12, 0.1, 0.12, 0.05) + np.c_[np.zeros((800, 2)), noise[:800]]
    elevation = fuse(FINDER, np.concatenate([high, low])).elevation
    assert np.allclose(elevation[100:120, 100:110], 0.0)
    assert np.abs(elevation[100:120, 110:120] - 0.05).max() < 4 * FINDER.reading_noise / 2
    assert elevation[100:120, 110:120].mean() == pytest.approx(0.05, abs=1e-4)


def test_single_pinholes_are_filled_and_real_holes_stay():
    points = patch(0.1, 0.14, 0.1, 0.14, 0.02)
    cells = np.floor(points[:, :2] / CELL).astype(int)
    pinhole = (cells == (110, 110)).all(axis=1)
    hole = (np.abs(cells - (125, 125)) <= 1).all(axis=1)
    elevation = fuse(FINDER, points[~pinhole & ~hole]).elevation
    assert elevation[110, 110] == pytest.approx(0.02)
    assert np.isnan(elevation[124:127, 124:127]).sum() >= 5


def test_a_pinhole_on_a_step_is_not_filled():
    step = np.concatenate([patch(0.1, 0.11, 0.1, 0.12, 0.0), patch(0.11, 0.12, 0.1, 0.12, 0.03)])
    pinhole = (np.floor(step[:, :2] / CELL).astype(int) == (110, 110)).all(axis=1)
    assert np.isnan(fuse(FINDER, step[~pinhole]).elevation[110, 110])


def test_readings_outside_the_area_or_not_finite_are_dropped():
    strays = np.array([[-0.01, 0.1, 0], [0.1, 0.41, 0], [0.1, 0.1, 0.9], [np.nan, 0.1, 0.0]])
    assert np.isnan(fuse(FINDER, strays).elevation).all()
    assert np.isnan(fuse(FINDER, np.empty((0, 3))).elevation).all()


def test_light_passed_over_a_hole_on_its_way_to_the_readings_beyond():
    """Over a hole the laser's light came down to its slope; a camera's line of sight counts too, where that camera saw the reading."""
    ground = patch(0.05, 0.35, 0.15, 0.25, 0.0)
    hole = (ground[:, 0] > 0.30) & (ground[:, 0] < 0.31)
    readings = np.concatenate([ground[~hole], patch(0.05, 0.07, 0.05, 0.07, 0.2)])  # lines are followed up to the highest reading
    by_laser = fuse(FINDER, readings)
    cells = np.isnan(by_laser.elevation[160:240, 300:310])
    assert cells.any()
    heights = by_laser.passed[160:240, 300:310][cells]
    slope = FINDER.laser[2] / (0.31 - FINDER.laser[0])
    assert (heights > 0).all() and heights.max() < 1.3 * slope * 0.01
    for camera in range(len(FINDER.cameras)):
        seen = fuse(FINDER, readings, np.full(len(readings), camera)).passed[160:240, 300:310][cells]
        assert (seen <= heights + 1e-12).all() and (seen < heights - 0.001).any()


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"T_world_range": from_xyz_rpy((0, 0, 0), (0.2, 0, 0))}, "z up"),
        ({"cell": 0.0}, "cells"),
        ({"planes": 1}, "planes"),
        ({"cameras": ()}, "camera"),
    ],
)
def test_an_impossible_instrument_is_refused_in_a_sentence(change, word):
    with pytest.raises(BadInput, match=word):
        replace(FINDER, **change)
