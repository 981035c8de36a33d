import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from handey_studio.geometry import Polyhedron, box, polyhedron_from_polygons
from handey_studio.geometry.distances import signed_distances, surface_of
from handey_studio.world import Library

LIBRARY = Library.choose()
SPIKE = polyhedron_from_polygons(
    [[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0], [0.002, 0.002, 0.2], [-0.05, -0.05, -0.01]],
    [[0, 1, 3], [1, 2, 3], [2, 0, 3], [1, 0, 4], [2, 1, 4], [0, 2, 4]],
)
SOLIDS = {name: LIBRARY.part(name).solid for name in sorted(LIBRARY.part_files())} | {"spike": SPIKE, "box": box((0.1, 0.05, 0.02))}


def naive(solid: Polyhedron, points: NDArray) -> tuple[NDArray, NDArray]:
    """Distances (n,) by every triangle, and the solid angle (n,) that the surface fills, in full turns: 1 inside, 0 outside."""
    corners = solid.vertices[solid.triangles]
    every = np.repeat(corners[None], len(points), axis=0).reshape(-1, 3, 3)
    near = trimesh.triangles.closest_point(every, np.repeat(points, len(corners), axis=0))
    off = np.linalg.norm(near.reshape(len(points), -1, 3) - points[:, None], axis=2)
    a, b, c = (corners[None, :, k] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=2)
    angle = 2 * np.arctan2(volume, la * lb * lc + (a * b).sum(2) * lc + (b * c).sum(2) * la + (c * a).sum(2) * lb)
    return off.min(axis=1), angle.sum(axis=1) / (4 * np.pi)


@pytest.mark.parametrize("name", SOLIDS)
def test_distances_are_those_of_every_triangle_and_the_solid_angle(name):
    solid, rng = SOLIDS[name], np.random.default_rng(3)
    spread = rng.uniform(solid.vertices.min(axis=0) - 0.05, solid.vertices.max(axis=0) + 0.05, (400, 3))
    close = solid.vertices[rng.integers(0, len(solid.vertices), 400)] + rng.normal(0, 0.003, (400, 3))  # where the sign is hard
    points = np.concatenate([spread, close])
    distances, faces = signed_distances(surface_of(solid), points)
    off, filled = naive(solid, points)
    assert np.abs(np.abs(distances) - off).max() < 1e-12
    clear = off > 1e-9
    assert ((distances < 0) == (filled > 0.5))[clear].all()
    heights = (points * solid.normals[faces]).sum(axis=1) - solid.offsets[faces]
    assert (np.abs(heights) <= off + 1e-12).all()


@given(st.integers(0, 10**6), st.floats(1e-5, 0.004))
@settings(max_examples=30, deadline=None)
def test_a_point_pushed_off_a_face_is_so_far_off_it(seed, distance):
    rng = np.random.default_rng(seed)
    solid = SOLIDS[sorted(SOLIDS)[seed % len(SOLIDS)]]
    t = int(rng.integers(len(solid.triangles)))
    face, share = int(solid.face_of_triangle[t]), rng.dirichlet((2, 2, 2))
    spot = share @ solid.vertices[solid.triangles[t]]
    outside, nearest = signed_distances(surface_of(solid), (spot + distance * solid.normals[face])[None])
    assert 0 < outside[0] <= distance + 1e-12
    on, at = signed_distances(surface_of(solid), spot[None])
    assert abs(on[0]) < 1e-12 and (at[0] == face or share.min() < 1e-6)
    assert outside[0] < distance - 1e-12 or nearest[0] == face
