"""The support plane, hidden in noise and clutter and found again."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.geometry.transforms import from_xyz_rpy, inverse, is_rigid, transform
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole
from handey_studio.sensing.support import support_plane, support_planes
from tests.sensing.scenes import bin_walls, cast, looking_at, pile

PINHOLE = Pinhole(200.0, 200.0, 79.5, 59.5)


def view_of_table(T_world_sensor, rng, boxes=3, noise=0.0015):
    """Depth (120, 160) of the plane z = 0 with flat-topped columns on it that cover up to a third."""
    v, u = np.mgrid[:120, :160].astype(float)
    rays = PINHOLE.unproject(np.stack([u, v], axis=-1), np.ones(u.shape)) @ T_world_sensor[:3, :3].T
    origin = T_world_sensor[:3, 3]
    height = np.zeros(u.shape)
    for _ in range(boxes):
        j, i = rng.integers(0, 90), rng.integers(0, 120)
        height[j : j + 30, i : i + 40] = rng.uniform(0.02, 0.2)
    depth = (height - origin[2]) / rays[..., 2]
    depth += rng.normal(0, noise, depth.shape)
    depth[(depth <= 0) | (rng.random(depth.shape) < 0.1)] = np.nan
    return DepthView(depth, PINHOLE, noise=noise)


@settings(max_examples=25, deadline=None)
@given(st.floats(-0.7, 0.7), st.floats(-0.5, 0.5), st.floats(-3.0, 3.0), st.integers(0, 10_000))
def test_the_table_is_found_under_clutter(roll, pitch, yaw, seed):
    rng = np.random.default_rng(seed)
    T = from_xyz_rpy((0.0, 0.0, 0.9), (np.pi + roll, pitch, yaw))
    found = support_plane(view_of_table(T, rng), rng)
    assert found.found and is_rigid(found.T_world_sensor)
    assert abs(found.T_world_sensor[2, 3] - 0.9) < 0.002
    tilt = found.T_world_sensor[2, :3] @ T[2, :3]
    assert tilt > np.cos(np.deg2rad(0.3))
    assert np.allclose(inverse(found.T_world_sensor)[:3, 3] @ found.T_world_sensor[2, :3] * -1, found.T_world_sensor[2, 3])
    assert np.allclose(found.T_world_sensor[:2, 3], 0.0)
    assert found.rms < 0.003


def test_the_floor_wins_over_a_larger_shelf_above_it():
    rng = np.random.default_rng(3)
    T = from_xyz_rpy((0.0, 0.0, 1.0), (np.pi, 0.0, 0.0))
    depth = np.full((120, 160), 1.0)
    depth[:, :100] = 0.7
    found = support_plane(DepthView(depth + rng.normal(0, 0.001, depth.shape), PINHOLE, noise=0.001), rng)
    assert found.found and abs(found.T_world_sensor[2, 3] - T[2, 3]) < 0.002


@pytest.mark.parametrize("kind", ["noise", "nothing"])
def test_no_plane_is_a_result_with_a_reason(kind):
    rng = np.random.default_rng(0)
    depth = rng.uniform(0.5, 2.0, (60, 80)) if kind == "noise" else np.full((60, 80), np.nan)
    found = support_plane(DepthView(depth, PINHOLE), rng)
    assert not found.found and found.reason
    assert np.array_equal(found.T_world_sensor, np.eye(4))


def test_a_seed_gives_the_same_plane():
    view = view_of_table(from_xyz_rpy((0, 0, 0.8), (np.pi + 0.4, 0, 0)), np.random.default_rng(5))
    assert support_plane(view, np.random.default_rng(1)) == support_plane(view, np.random.default_rng(1))


KINECT = Pinhole(525.0, 525.0, 319.5, 239.5)


def noisy(depth, rng, noise=0.001):
    return DepthView(depth + rng.normal(0.0, noise, depth.shape), KINECT, noise=noise)


def stands_at(supports, T_world_sensor, z):
    """Whether the table is the world's plane at height z [m]."""
    found = supports.table.T_world_sensor
    level = found[2, :3] @ T_world_sensor[2, :3] > np.cos(np.deg2rad(0.5))
    return supports.table.found and level and abs(found[2, 3] - (T_world_sensor[2, 3] - z)) < 0.003


@pytest.mark.parametrize("eye", [(0.02, -0.05, 0.9), (0.1, -0.45, 0.75), (-0.3, -0.35, 0.75)])
@pytest.mark.parametrize("table", [None, 0.0, -0.02])
def test_a_bin_stands_on_its_floor_or_on_the_table_around_it_and_not_on_its_walls(eye, table):
    rng = np.random.default_rng(5)
    T = looking_at(eye, (0.0, 0.0, 0.05))
    floor = (transform(translation=(0.0, 0.0, -0.002)), np.array([0.2, 0.15, 0.002]))
    boxes = [*bin_walls(0.4, 0.3, 0.15), floor, *pile(rng, 10, 0.1, (0.02, 0.04))]
    supports = support_planes(noisy(cast(boxes, T, KINECT, (480, 640), table), rng), rng)
    assert stands_at(supports, T, 0.0 if table is None else table)
    assert supports.walls or eye[0] == 0.02  # from straight above the walls are slivers
    for wall in supports.walls:
        assert abs(wall.normal_sensor @ T[2, :3]) < 0.1


@pytest.mark.parametrize("seed", range(3))
def test_clutter_over_four_fifths_of_the_table_leaves_the_table(seed):
    rng = np.random.default_rng(seed)
    narrow = Pinhole(450.0, 450.0, 159.5, 119.5)
    T = looking_at((rng.uniform(-0.3, 0.3), rng.uniform(-0.4, -0.1), 0.8), (0.0, 0.0, 0.0))
    depth = cast(pile(rng, 75, 0.3, (0.03, 0.06)), T, narrow, (240, 320))
    assert np.mean(np.abs(depth - cast([], T, narrow, (240, 320))) < 1e-6) < 0.25
    view = DepthView(depth + rng.normal(0.0, 0.001, depth.shape), narrow, noise=0.001)
    assert stands_at(support_planes(view, rng), T, 0.0)


@pytest.mark.parametrize("step", [0.05, 0.2])
def test_two_tables_are_both_told_and_the_lower_one_is_the_table(step):
    rng = np.random.default_rng(6)
    T = looking_at((0.0, -0.3, 0.9), (0.0, 0.0, 0.0))
    upper = (transform(translation=(0.6, 0.0, step - 0.01)), np.array([0.6, 2.0, 0.01]))
    supports = support_planes(noisy(cast([upper, *pile(rng, 4)], T, KINECT, (480, 640)), rng), rng)
    assert stands_at(supports, T, 0.0)
    assert [round(level.height, 2) for level in supports.levels if level.share > 0.1] == [0.0, step]


def test_the_rooms_floor_beyond_the_table_is_no_support():
    rng = np.random.default_rng(7)
    T = looking_at((0.0, -0.5, 0.6), (0.0, 0.0, 0.0))
    table = (transform(translation=(0.0, 0.0, -0.01)), np.array([0.5, 0.35, 0.01]))
    depth = cast([table, *pile(rng, 5)], T, KINECT, (480, 640), table=-0.75)
    assert stands_at(support_planes(noisy(depth, rng), rng), T, 0.0)


def test_a_plane_that_fills_the_view_is_the_table():
    rng = np.random.default_rng(8)
    supports = support_planes(noisy(np.full((480, 640), 0.8), rng), rng)
    assert supports.table.found and supports.table.share > 0.98 and not supports.walls
    assert supports.table.inliers == pytest.approx(0.99 * 480 * 640, rel=0.02)


def test_a_parallel_view_has_supports_too():
    rng = np.random.default_rng(9)
    above = Orthographic(0.001, 199.5, 199.5)
    T = looking_at((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    depth = cast(pile(rng, 15), T, above, (400, 400))
    supports = support_planes(DepthView(depth + rng.normal(0, 0.0005, depth.shape), above, noise=0.0005), rng)
    assert stands_at(supports, T, 0.0)


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (6, 500)])
def test_views_too_small_have_no_support(shape):
    found = support_plane(DepthView(np.full(shape, 0.7), KINECT), np.random.default_rng(0))
    assert not found.found and found.reason


def test_it_is_quick():
    rng = np.random.default_rng(10)
    view = noisy(cast(pile(rng, 15), looking_at((0.1, -0.4, 0.7), (0, 0, 0)), KINECT, (480, 640)), rng)
    support_planes(view, rng)
    begun = time.process_time()
    for _ in range(5):
        support_planes(view, rng)
    assert (time.process_time() - begun) / 5 < 0.06
