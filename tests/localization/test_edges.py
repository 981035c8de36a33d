"""Edges from the depth of a known scene: they lie where the part's edges are, and nothing else is taken for one."""

import numpy as np

from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy, transform
from handey_studio.localization.edges import JUMP, edge_pixels
from handey_studio.localization.segments import data_edges, link
from handey_studio.localization.surface import surface_of
from handey_studio.sensing.depth_view import DepthView, Orthographic
from tests.localization.rendering import looking_at, map_from_above, oblique_view


def edges_of(view, shortest=0.01):
    surface = surface_of(view)
    pixels = edge_pixels(view, surface)
    return data_edges(view, surface, pixels, link(view, surface, pixels), shortest)


def test_a_box_from_above_shows_its_top_outline():
    T = from_xyz_rpy((0.48, 0.01, 0.015), (0, 0, 0.4))
    edges = edges_of(map_from_above([(box([0.08, 0.05, 0.03]), T)], np.random.default_rng(0)).view(), 0.02)
    assert len(edges) == 4 and {edge.kind for edge in edges} == {"jump"}
    short = np.array([0.05, 0.05, 0.08, 0.08]) - sorted(edge.length for edge in edges)
    assert (short > -0.0005).all() and (short < 0.006).all(), "an edge loses its corners, and never gains"
    for edge in edges:
        assert np.allclose(edge.ends_world[:, 2], 0.03, atol=0.0006)
        in_part = (edge.ends_world.mean(axis=0) - T[:3, 3]) @ T[:3, :3]
        off = np.abs(np.abs(in_part[:2]) - (0.04, 0.025)).min()
        assert off < 0.001
        outwards = edge.ends_world.mean(axis=0) - T[:3, 3]
        inward_world = edge.inward_sensor[0] * (1, -1, -1)
        assert inward_world @ outwards < 0


def test_a_box_seen_obliquely_shows_convex_creases_and_its_foot():
    T = from_xyz_rpy((0.48, 0.0, 0.03), (0, 0, 0.6))
    T_world_sensor = looking_at(np.array([0.48, -0.4, 0.4]), np.array([0.48, 0.0, 0.02]))
    edges = edges_of(oblique_view([(box([0.1, 0.07, 0.06]), T)], T_world_sensor, np.random.default_rng(1)), 0.03)
    creases = [edge for edge in edges if edge.kind == "convex"]
    feet = [edge for edge in edges if edge.kind == "concave"]
    assert len(creases) >= 3 and len(feet) >= 2
    for edge in feet:
        assert np.abs(edge.ends_world[:, 2]).max() < 0.006
    for edge in creases:
        assert len(edge.normals_sensor) == 2
        assert abs(edge.normals_sensor[0] @ edge.normals_sensor[1]) < 0.2


def test_a_bend_in_depth_cuts_an_outline_that_is_straight_in_the_image():
    v, u = np.mgrid[:120, :120].astype(float)
    roof = 0.9 + 0.8 * np.abs(v - 60) * 0.001
    depth = np.where((np.abs(u - 60) < 25) & (np.abs(v - 60) < 40), roof, 1.0)
    depth = depth + np.random.default_rng(0).normal(0, 0.0003, depth.shape)
    edges = edges_of(DepthView(depth, Orthographic(0.001, 59.5, 59.5), noise=0.0003, outline_error=0.001), 0.02)
    sides = [edge for edge in edges if edge.kind == "jump" and abs(edge.direction[1]) > 0.5]
    assert len(sides) == 4
    assert {round(abs(edge.direction[2] / edge.direction[1]), 1) for edge in sides} == {0.8}
    assert any(edge.kind == "convex" for edge in edges)


def test_a_noisy_slope_with_holes_has_no_edges():
    rng = np.random.default_rng(2)
    v, u = np.mgrid[:200, :200].astype(float)
    depth = 0.8 + 0.0006 * u - 0.0003 * v + rng.normal(0, 0.0005, u.shape)
    depth[rng.random(depth.shape) < 0.05] = np.nan
    depth[90:110, 60:80] = np.nan
    view = DepthView(depth, Orthographic(0.001, 99.5, 99.5), noise=0.0005, outline_error=0.001)
    assert edges_of(view) == ()


def test_jump_pixels_lie_on_the_nearer_surface():
    depth = np.full((60, 60), 1.0)
    depth[20:40, 20:40] = 0.95
    depth[20:40, 40:48] = np.nan
    view = DepthView(depth, Orthographic(0.001, 29.5, 29.5), transform(), noise=0.0003, outline_error=0.001)
    kind = edge_pixels(view, surface_of(view)).kind
    j, i = np.nonzero(kind == JUMP)
    assert np.all(depth[j, i] == 0.95)
    assert (kind[20:40, 39] == JUMP).all() and (kind[20:40, 20] == JUMP).all()
