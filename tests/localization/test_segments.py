"""Lines of edges: as far from the true ones as their sigmas say, on the surface that owns them, and none where planes go on."""

import numpy as np
import pytest

from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole
from tests.localization.boxes import box_edges, depth_of, edges_of, errors
from tests.localization.rendering import looking_at


def random_view(rng, noise):
    """A box hovering anyhow over the table before an oblique camera; its true edges."""
    size = rng.uniform([0.04, 0.04, 0.03], [0.12, 0.1, 0.1])
    T = from_xyz_rpy((*rng.uniform(-0.03, 0.03, 2), 0.12), (*rng.uniform(-0.5, 0.5, 2), rng.uniform(-3, 3)))
    azimuth, height = rng.uniform(-3, 3), rng.uniform(0.5, 1.4)
    eye = 0.6 * np.array([np.cos(azimuth) * np.cos(height), np.sin(azimuth) * np.cos(height), np.sin(height)])
    pinhole, T_world_sensor = Pinhole(600.0, 600.0, 159.5, 119.5), looking_at(eye, np.array([0, 0, 0.1]))
    depth = depth_of([(size, T)], pinhole, T_world_sensor, (240, 320))
    noisy = depth + rng.normal(0, noise, depth.shape) * (depth / np.nanmedian(depth)) ** 2
    return DepthView(noisy, pinhole, T_world_sensor, noise=noise, outline_error=0.001), box_edges([(size, T)])


@pytest.mark.parametrize("noise", [0.0004, 0.001])
def test_errors_are_what_the_sigmas_say(noise):
    rng = np.random.default_rng(3)
    found = {"jump": [], "convex": [], "concave": []}
    for _ in range(20):
        view, true = random_view(rng, noise)
        for edge in edges_of(view, 0.015):
            distance, angle = errors(edge, true)
            found[edge.kind].append((distance, angle, edge.offset_sigma, edge.angle_sigma))
    for kind in ("jump", "convex"):
        distance, angle, offset_sigma, angle_sigma = np.array(found[kind]).T
        assert len(distance) > 15
        assert 0.3 < np.median(distance / offset_sigma) < 2.0, kind
        assert 0.3 < np.median(angle / angle_sigma) < 2.0, kind
        assert np.mean((distance > 5 * offset_sigma) & (distance > 0.0005)) < 0.1, kind
        assert np.median(distance) < 0.00015 and np.median(angle) < np.deg2rad(0.35), kind
    assert len(found["concave"]) < 0.1 * len(found["jump"]), "nothing touches: no concave edges"


def test_a_blunt_ridge_is_found_and_placed_by_its_planes():
    v, u = np.mgrid[:120, :160].astype(float)
    across = (u - 80) * np.cos(0.3) + (v - 60) * np.sin(0.3)
    depth = 0.8 + np.tan(np.deg2rad(15.0)) * 0.001 * np.abs(across - 0.4) + np.random.default_rng(5).normal(0, 0.0005, u.shape)
    edges = edges_of(DepthView(depth, Orthographic(0.001, 80.0, 60.0), noise=0.0005, outline_error=0.001), 0.05)
    assert len(edges) >= 1 and {edge.kind for edge in edges} == {"convex"}
    for edge in edges:
        off = edge.ends_sensor[:, :2] @ (np.cos(0.3), np.sin(0.3)) - 0.0004
        assert np.abs(off).max() < 0.0005 and np.abs(edge.ends_sensor[:, 2] - 0.8).max() < 0.0003
        assert abs(np.arccos(edge.normals_sensor[0] @ edge.normals_sensor[1]) - np.deg2rad(30.0)) < np.deg2rad(2.0)
        assert (edge.inward_sensor[:, 2] > 0).all(), "both surfaces fall away from a ridge"


def test_only_the_nearer_surface_owns_a_jump():
    size, T = np.array([0.1, 0.06, 0.05]), from_xyz_rpy((0, 0, 0.025), (0, 0, 0.5))
    T_world_sensor = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1], [0, 0, 0, 1]])
    depth = depth_of([(size, T)], Orthographic(0.001, 99.5, 99.5), T_world_sensor, (200, 200))
    depth = depth + np.random.default_rng(0).normal(0, 0.0005, depth.shape)
    edges = edges_of(DepthView(depth, Orthographic(0.001, 99.5, 99.5), T_world_sensor, 0.0005, 0.001))
    assert len(edges) == 4
    for edge in edges:
        assert edge.kind == "jump" and np.allclose(edge.ends_world[:, 2], 0.05, atol=0.0005)
        middle = edge.ends_sensor.mean(axis=0) - (0, 0, 0.95)
        assert edge.inward_sensor[0] @ middle < 0


def test_a_silhouette_is_placed_between_its_last_reading_and_the_next():
    for shift in (0.1, 0.35, 0.6, 0.85):
        v, u = np.mgrid[:100, :100].astype(float)
        depth = np.where(v + 0.21 * u < 60.0 + shift, 0.9, 1.0)
        edges = edges_of(DepthView(depth, Orthographic(0.001, 0.0, 0.0), noise=0.0002, outline_error=0.001), 0.05)
        assert len(edges) == 1
        off = edges[0].ends_sensor[:, 1] + 0.21 * edges[0].ends_sensor[:, 0] - 0.001 * (60.0 + shift)
        assert np.abs(off).max() < 0.00015
