"""The support plane, hidden in noise and clutter and found again."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.geometry.transforms import from_xyz_rpy, inverse, is_rigid
from handey_studio.sensing.depth_view import DepthView, Pinhole
from handey_studio.sensing.support import support_plane

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
