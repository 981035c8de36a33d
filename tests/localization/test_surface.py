"""The surface's normals: running sums give what least squares pixel by pixel gives, and jumps do not bend them."""

import numpy as np

from handey_studio.localization.surface import surface_of, window_radius
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole


def slope_by_least_squares(depth, v, u, radius):
    """The oracle: a plane through all readings of the window."""
    y, x = np.mgrid[: depth.shape[0], : depth.shape[1]]
    rows = slice(max(v - radius, 0), v + radius + 1), slice(max(u - radius, 0), u + radius + 1)
    y, x, d = y[rows], x[rows], depth[rows]
    known = np.isfinite(d)
    return np.linalg.lstsq(np.c_[x[known], y[known], np.ones(known.sum())], d[known], rcond=None)[0][:2]


def test_running_sums_are_least_squares_in_each_window():
    rng = np.random.default_rng(0)
    v, u = np.mgrid[:90, :110].astype(float)
    depth = 0.8 + 0.0006 * u - 0.0003 * v + 2e-6 * (u - 50) ** 2 + rng.normal(0, 0.0005, u.shape)
    depth[rng.random(depth.shape) < 0.05] = np.nan
    depth[20:40, 60:64] = np.nan
    view = DepthView(depth, Orthographic(0.001, 54.5, 44.5), noise=0.0006, outline_error=0.001)
    surface = surface_of(view)
    places = [(0, 0), (89, 109), (30, 59), *zip(rng.integers(0, 90, 60), rng.integers(0, 110, 60), strict=True)]
    known = [(j, i) for j, i in places if np.isfinite(depth[j, i])]
    assert len(known) > 40
    for j, i in known:
        assert np.allclose(surface.slope[j, i], slope_by_least_squares(depth, j, i, surface.radius_px), atol=2e-6), (j, i)


def test_normals_stop_at_a_jump():
    _, u = np.mgrid[:80, :80].astype(float)
    tilted = 0.60 + 0.0005 * u
    depth = np.where(u < 40, tilted, 0.70) + np.random.default_rng(1).normal(0, 0.0003, u.shape)
    view = DepthView(depth, Orthographic(0.001, 39.5, 39.5), noise=0.0003, outline_error=0.001)
    normals = surface_of(view).normals
    left, right = np.array([0.5, 0.0, -1.0]) / np.sqrt(1.25), np.array([0.0, 0.0, -1.0])
    assert (normals[:, 32:40] @ left).min() > np.cos(0.15)
    assert (normals[:, 40:48] @ right).min() > np.cos(0.15)


def test_normals_of_a_plane_seen_in_perspective():
    pinhole = Pinhole(500.0, 500.0, 39.5, 39.5)
    true = np.array([0.3, -0.4, -1.0]) / np.linalg.norm([0.3, -0.4, -1.0])
    v, u = np.mgrid[:80, :80].astype(float)
    rays = pinhole.unproject(np.stack([u, v], axis=-1), np.ones(u.shape))
    depth = (true @ [0.0, 0.0, 0.7]) / (rays @ true)
    normals = surface_of(DepthView(depth, pinhole, noise=0.0003)).normals
    assert np.allclose(normals[8:-8, 8:-8], true, atol=2e-3)


def test_the_window_grows_with_the_noise():
    radii = [window_radius(noise, 0.001) for noise in (0.0, 0.0003, 0.0006, 0.0015, 0.01)]
    assert radii == sorted(radii) and radii[0] == 2 and radii[-1] == 6


def test_a_view_without_readings_has_no_normals():
    assert np.isnan(surface_of(DepthView(np.full((20, 30), np.nan), Pinhole(100.0, 100.0, 15.0, 10.0))).normals).all()
