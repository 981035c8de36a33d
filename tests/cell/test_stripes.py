"""Scans of true bodies: heights, outlines, shadow, noise, and that space between laser and reading is empty."""

from dataclasses import replace

import numpy as np
import pytest

from handey_studio.cell.bodies import SolidBody, fixed_bodies
from handey_studio.cell.stripes import Surfaces, photograph, stripe_peaks
from handey_studio.cell.workcell import Workcell
from handey_studio.geometry import box
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse
from handey_studio.sensing.stripes.range_finder import triangulate

CELL = Workcell()
FINDER = CELL.finder
SIZE = np.array([0.06, 0.10, 0.08])
T_BOX = from_xyz_rpy((0.52, 0.05, 0.04), (0.0, 0.0, 0.5))
BODIES = [*fixed_bodies(CELL), SolidBody("box", box(SIZE), T_BOX)]


@pytest.fixture(scope="module")
def depth_map():
    return photograph(FINDER, BODIES, np.random.default_rng(3))


def in_box(depth_map) -> tuple[np.ndarray, np.ndarray]:
    """Cell centres and their elevations, x and y in the box's frame."""
    j, i = np.mgrid[: depth_map.elevation.shape[0], : depth_map.elevation.shape[1]]
    centres = np.stack([(i + 0.5) * depth_map.cell, (j + 0.5) * depth_map.cell, np.zeros(i.shape)], axis=-1)
    return apply(inverse(T_BOX), apply(depth_map.T_world_range, centres))[..., :2], depth_map.elevation


def test_a_box_has_its_height_and_its_outline(depth_map):
    xy, elevation = in_box(depth_map)
    inner = (np.abs(xy) < SIZE[:2] / 2 - 0.002).all(axis=-1)
    assert np.isfinite(elevation[inner]).all()
    assert elevation[inner].mean() == pytest.approx(SIZE[2], abs=5e-5)
    assert np.abs(elevation[inner] - SIZE[2]).max() < 0.002
    high = elevation > 0.07
    assert (np.abs(xy[high]) < SIZE[:2] / 2 + 0.0015).all()
    assert np.abs(xy[high].max(axis=0) - SIZE[:2] / 2).max() < 0.0015


def test_what_the_laser_does_not_reach_has_no_reading(depth_map):
    xy, elevation = in_box(depth_map)
    j, i = np.mgrid[: elevation.shape[0], : elevation.shape[1]]
    floor = np.stack([(i + 0.5) * depth_map.cell, (j + 0.5) * depth_map.cell, np.zeros(i.shape)], axis=-1)
    beams = floor - FINDER.laser
    share = (FINDER.laser[2] - SIZE[2]) / FINDER.laser[2]
    crossing = apply(inverse(T_BOX), apply(depth_map.T_world_range, FINDER.laser + share * beams))[..., :2]
    shadow = (np.abs(crossing) < SIZE[:2] / 2 - 0.0015).all(axis=-1) & (np.abs(xy) > SIZE[:2] / 2 + 0.0015).any(axis=-1)
    assert shadow.sum() > 100
    assert np.isnan(elevation[shadow]).all()
    assert np.isfinite(elevation).mean() > 0.95


def test_the_noise_is_what_the_map_says(depth_map):
    xy, elevation = in_box(depth_map)
    top = elevation[(np.abs(xy) < SIZE[:2] / 2 - 0.003).all(axis=-1)]
    table = elevation[(np.abs(xy) > 0.12).any(axis=-1)]
    for level in (top, table[np.isfinite(table)]):
        assert 1.5e-4 < level.std() < 4.5e-4
        assert level.std() == pytest.approx(depth_map.noise, rel=0.35)


def test_peaks_without_noise_lie_exactly_on_the_true_faces():
    surfaces = Surfaces(BODIES, inverse(FINDER.T_world_range))
    for camera in range(2):
        peaks = stripe_peaks(FINDER, camera, surfaces)
        points = triangulate(FINDER, camera, peaks.u, peaks.v, peaks.plane)
        local = np.abs(apply(inverse(T_BOX), apply(FINDER.T_world_range, points)))
        on_box = np.abs(local - SIZE / 2).min(axis=1)
        assert np.minimum(on_box, np.abs(points[:, 2])).max() < 1e-6
        assert len(points) > 200_000


def test_space_between_laser_and_readings_is_empty(depth_map):
    points = depth_map.points_world()[::97]
    laser = apply(depth_map.T_world_range, FINDER.laser)
    for share in np.linspace(0.5, 0.97, 25):
        local = np.abs(apply(inverse(T_BOX), laser + share * (points - laser)))
        assert not (local < SIZE / 2 - 0.001).all(axis=1).any()


def test_where_light_passed_nothing_truly_is(depth_map):
    """Above `passed` every cell is empty in truth: the columns of the true box never reach above it."""
    j, i = np.mgrid[: depth_map.elevation.shape[0], : depth_map.elevation.shape[1]]
    above = np.stack([(i + 0.5) * depth_map.cell, (j + 0.5) * depth_map.cell, depth_map.passed + 0.002], axis=-1).reshape(-1, 3)
    local = np.abs(apply(inverse(T_BOX), apply(depth_map.T_world_range, above)))
    assert not (local < SIZE / 2 - 0.001).all(axis=1).any()


def test_a_seed_gives_the_same_scan_and_another_seed_another():
    few = replace(FINDER, planes=200)
    maps = [photograph(few, BODIES, np.random.default_rng(seed)).elevation for seed in (1, 1, 2)]
    assert np.array_equal(maps[0], maps[1], equal_nan=True)
    assert not np.array_equal(maps[0], maps[2], equal_nan=True)


def test_a_scan_moves_with_the_instrument():
    """The same box before an instrument that stands elsewhere and turned reads the same."""
    T_shift = from_xyz_rpy((0.1, -0.2, 0.0), (0.0, 0.0, 0.7))
    moved = replace(FINDER, T_world_range=T_shift @ FINDER.T_world_range, planes=200)
    body = SolidBody("box", box(SIZE), T_shift @ T_BOX)
    table = BODIES[0]
    here = photograph(replace(FINDER, planes=200), BODIES, np.random.default_rng(0)).elevation
    there = photograph(moved, [table, body], np.random.default_rng(0)).elevation
    both = np.isfinite(here) & np.isfinite(there)
    assert both.mean() > 0.9 * np.isfinite(here).mean()
    assert np.median(np.abs(here - there)[both]) < 5e-4
