import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.geometry import box, convex_pieces, polyhedron_from_polygons, prism, symmetries
from handey_studio.geometry.transforms import apply, from_xyz_rpy

L_OUTLINE = [[0, 0], [0.06, 0], [0.06, 0.03], [0.03, 0.03], [0.03, 0.07], [0, 0.07]]
sizes = st.tuples(*[st.floats(0.01, 0.3)] * 3)


@given(sizes)
def test_a_box_is_a_box(size):
    solid = box(size)
    volume, centroid = solid.volume_and_centroid
    assert np.isclose(volume, np.prod(size)) and np.allclose(centroid, 0)
    assert len(solid.edges) == 12 and all(np.isclose(edge.dihedral, np.pi / 2) for edge in solid.edges)
    assert trimesh.Trimesh(solid.vertices, solid.triangles, process=False).is_watertight


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_triangulated_input_gets_its_polygon_faces_back(seed):
    rng = np.random.default_rng(seed)
    solid = prism(L_OUTLINE, 0.04)
    T = from_xyz_rpy(rng.uniform(-1, 1, 3), rng.uniform(-3, 3, 3))
    order = rng.permutation(len(solid.triangles))
    again = polyhedron_from_polygons(apply(T, solid.vertices), solid.triangles[order].tolist())
    assert sorted(len(face.outer) for face in again.faces) == [4, 4, 4, 4, 4, 4, 6, 6]
    assert np.isclose(again.volume_and_centroid[0], solid.volume_and_centroid[0])
    assert sum(edge.dihedral < 0 for edge in again.edges) == 1


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_slivers_along_edges_join_no_faces_that_are_not_coplanar(seed):
    """An edge between two faces, split on one side only: the triangle without area between them touches both."""
    rng = np.random.default_rng(seed)
    solid = prism(L_OUTLINE, 0.04)
    corners, triangles = apply(from_xyz_rpy(rng.uniform(-1, 1, 3), rng.uniform(-3, 3, 3)), solid.vertices), solid.triangles.tolist()
    for _ in range(rng.integers(1, 8)):
        number = int(rng.integers(len(triangles)))
        a, b, c = np.roll(triangles.pop(number), rng.integers(3)).tolist()
        corners = np.vstack([corners, corners[a] + rng.uniform(0.1, 0.9) * (corners[b] - corners[a]) + rng.normal(0, 5e-9, 3)])
        middle = len(corners) - 1
        triangles += [[a, middle, c], [middle, b, c], [a, b, middle]]
    again = polyhedron_from_polygons(corners, [triangles[k] for k in rng.permutation(len(triangles))])
    assert sorted(len(face.outer) for face in again.faces) == [4, 4, 4, 4, 4, 4, 6, 6]
    assert np.isclose(again.volume_and_centroid[0], solid.volume_and_centroid[0], rtol=1e-5)


def test_corners_either_side_of_a_grid_line_are_one():
    corners = np.vstack([box((0.1, 0.1, 0.1)).vertices, box((0.1, 0.1, 0.1)).vertices]) + 0.5e-6 + np.repeat([[0.0], [1e-9]], 8, axis=0)
    polygons = [[c + 8 * (f % 2) for c in face.outer] for f, face in enumerate(box((0.1, 0.1, 0.1)).faces)]
    solid = polyhedron_from_polygons(corners, polygons)
    assert len(solid.vertices) == 8 and len(solid.faces) == 6


def test_a_face_with_a_hole_keeps_it():
    ring = trimesh.creation.annulus(0.02, 0.05, 0.03, sections=8)
    solid = polyhedron_from_polygons(ring.vertices, ring.faces.tolist())
    assert sum(len(face.holes) for face in solid.faces) == 2
    assert np.isclose(solid.volume_and_centroid[0], ring.volume)


@pytest.mark.parametrize(
    "outline", [L_OUTLINE, [[0, 0], [0.09, 0], [0.09, 0.03], [0.06, 0.03], [0.06, 0.06], [0.03, 0.06], [0.03, 0.03], [0, 0.03]]]
)
def test_convex_pieces_fill_the_solid_exactly(outline):
    solid = prism(outline, 0.04)
    pieces = [
        trimesh.Trimesh(piece).convex_hull if len(piece) == 0 else trimesh.convex.convex_hull(piece) for piece in convex_pieces(solid)
    ]
    assert len(pieces) > 1
    assert np.isclose(sum(piece.volume for piece in pieces), solid.volume_and_centroid[0])
    points = np.random.default_rng(0).uniform(solid.vertices.min(axis=0), solid.vertices.max(axis=0), (2000, 3))
    inside = trimesh.Trimesh(solid.vertices, solid.triangles).contains(points)
    in_pieces = np.any([piece.contains(points) for piece in pieces], axis=0)
    assert (inside == in_pieces).mean() > 0.999


@pytest.mark.parametrize(
    ("solid", "count"),
    [
        (box((0.1, 0.2, 0.3)), 4),
        (box((0.1, 0.1, 0.3)), 8),
        (box((0.1, 0.1, 0.1)), 24),
        (box((0.002, 0.002, 0.08)), 8),
        (prism(L_OUTLINE, 0.04), 1),
    ],
)
def test_symmetries_are_found_from_the_shape(solid, count):
    found = symmetries(solid)
    assert len(found) == count and np.allclose(found[0], np.eye(4))
    for T in found:
        moved = apply(T, solid.vertices)
        assert max(np.linalg.norm(solid.vertices - corner, axis=1).min() for corner in moved) < 1e-6


def _cube():
    cube = box((0.1, 0.1, 0.1))
    return cube.vertices.copy(), [list(face.outer) for face in cube.faces]


def test_an_open_surface_is_refused():
    vertices, polygons = _cube()
    with pytest.raises(BadInput, match="its surface has holes"):
        polyhedron_from_polygons(vertices, polygons[:-1])


def test_a_bent_face_is_refused():
    vertices, polygons = _cube()
    vertices[0] += 0.01
    with pytest.raises(BadInput, match="bent"):
        polyhedron_from_polygons(vertices, polygons)


def test_nan_is_refused():
    vertices, polygons = _cube()
    vertices[0, 0] = np.nan
    with pytest.raises(BadInput, match="finite"):
        polyhedron_from_polygons(vertices, polygons)


def test_a_surface_through_itself_is_refused():
    a, b = box((0.1, 0.1, 0.1)), box((0.05, 0.05, 0.3))
    vertices = np.concatenate([a.vertices, apply(from_xyz_rpy((0.01, 0.012, 0), (0, 0, 0.3)), b.vertices)])
    polygons = [list(face.outer) for face in a.faces] + [[c + 8 for c in face.outer] for face in b.faces]
    with pytest.raises(BadInput, match="passes through itself"):
        polyhedron_from_polygons(vertices, polygons)


def test_an_inside_out_solid_is_turned_right():
    vertices, polygons = _cube()
    solid = polyhedron_from_polygons(vertices, [polygon[::-1] for polygon in polygons])
    assert solid.volume_and_centroid[0] > 0


@pytest.mark.parametrize("first", [0, 1, 2, 3])
def test_a_corner_that_is_listed_twice_is_one_corner(first):
    cube = box((1.0, 1.0, 1.0))
    loops = [list(face.outer) for face in cube.faces]
    corners = np.vstack([cube.vertices, cube.vertices[loops[0][first]]])
    loops[0].insert(first, 8)  # a side without length, also as the first one
    assert polyhedron_from_polygons(corners, loops).volume_and_centroid[0] == pytest.approx(1.0)


def test_a_face_whose_corners_coincide_is_refused_in_a_sentence():
    corners = np.vstack([np.eye(3), np.eye(3)[:1]])
    with pytest.raises(BadInput, match="no area"):
        polyhedron_from_polygons(corners, [[0, 3, 1, 1]])


def test_lips_of_a_micrometre_join_the_faces_in_whose_plane_they_lie():
    cubes = [manifold3d.Manifold.cube((20.001, 20.001, 20), True).translate((20 * k, 0, 0)) for k in range(4)]
    mesh = manifold3d.Manifold.batch_boolean(cubes, manifold3d.OpType.Add).to_mesh64()
    solid = polyhedron_from_polygons(np.asarray(mesh.vert_properties)[:, :3] * 1e-3, np.asarray(mesh.tri_verts).tolist())
    assert len(solid.faces) == 6
    for normal, offset, face in zip(solid.normals, solid.offsets, solid.faces, strict=True):
        assert np.abs(solid.vertices[list(face.outer)] @ normal - offset).max() < 2e-6
