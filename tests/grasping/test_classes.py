"""Grasp classes of all three feature pairs, and their approach groups, of ordinary and of unusual parts."""

import manifold3d
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from handey_studio.base import rejected_counts
from handey_studio.geometry import Polyhedron, box, polyhedron_from_polygons, prism
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse
from handey_studio.grasping import GraspOptions, contact_area, grasp_classes, grasp_groups
from handey_studio.world import Library, Part

LIBRARY = Library.choose()
HAND = LIBRARY.robot("ur5").hand


def manifold(size, at=(0.0, 0.0, 0.0)):
    """A cuboid of a size [mm] with its middle at a place [mm]."""
    return manifold3d.Manifold.cube(size, True).translate(at)


def solid(body) -> Polyhedron:
    """A manifold [mm] as a polyhedron [m]."""
    mesh = body.to_mesh64()
    return polyhedron_from_polygons(np.asarray(mesh.vert_properties)[:, :3] * 1e-3, np.asarray(mesh.tri_verts).tolist())


def hexagonal_rod(across_mm, height_mm):
    return manifold3d.Manifold.cylinder(height_mm, across_mm / 2, circular_segments=6, center=True)


def tetromino(cells):
    return solid(manifold3d.Manifold.batch_boolean([manifold((20, 20, 20), (20 * x, 20 * y, 0)) for x, y in cells], manifold3d.OpType.Add))


PYRAMID = polyhedron_from_polygons(
    np.array([[-0.02, -0.02, 0], [0.02, -0.02, 0], [0.02, 0.02, 0], [-0.02, 0.02, 0], [0.004, 0, 0.035]]),
    [[3, 2, 1, 0], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
)
PLATE = manifold((80, 60, 12)) - manifold((30, 20, 20)) - manifold((8, 8, 20), (30, 20, 0))
UNUSUAL = {
    "peg": solid(hexagonal_rod(24, 60) + hexagonal_rod(36, 8)),  # Cranfield's: a rod with a collar
    "spacer": solid(manifold((18, 18, 70)) - manifold((6, 30, 6), (0, 0, 20))),
    "side plate": solid(PLATE),
    "bracket": solid(manifold((60, 42, 6), (0, 0, 3)) + manifold((6, 42, 50), (27, 0, 25)) - manifold((20, 12, 20), (-10, 0, 0))),
    "t block": solid(manifold((80, 30, 20)) + manifold((20, 30, 60), (0, 0, -40))),
    "frame": solid(manifold((70, 70, 25)) - manifold((40, 40, 40))),
    "channel": solid(manifold((60, 50, 40)) - manifold((30, 60, 30), (0, 0, 10))),
    "pyramid": PYRAMID,
    "roof": prism([[-0.02, 0.0], [0.02, 0.0], [0.0, 0.03]], 0.06),
    **{
        f"tetromino {name}": tetromino(cells)
        for name, cells in {
            "S": [(0, 0), (1, 0), (1, 1), (2, 1)],
            "T": [(0, 0), (1, 0), (2, 0), (1, 1)],
            "L": [(0, 0), (1, 0), (2, 0), (2, 1)],
            "I": [(0, 0), (1, 0), (2, 0), (3, 0)],
            "O": [(0, 0), (1, 0), (0, 1), (1, 1)],
        }.items()
    },
}
PARTS = {name: LIBRARY.part(name) for name in sorted(LIBRARY.part_files())} | {name: Part(name, body) for name, body in UNUSUAL.items()}


def inside(part, points):
    return np.any([Delaunay(piece).find_simplex(points) >= 0 for piece in part.pieces], axis=0)


def pressed(found):
    """The two places (2, 3) [m], in the grasp plane's frame, where the fingers press in the middle of the contact."""
    y, z = shapely.get_coordinates(found.contact.representative_point())[0]
    return np.array([[found.width / 2, y, z], [-found.width / 2, y, z]])


@pytest.mark.parametrize("name", sorted(PARTS))
def test_between_the_fingers_there_is_the_part_and_beyond_them_nothing(name):
    """Whatever the pair of features: a hair inside both pads there is material, a hair outside there is none."""
    part = PARTS[name]
    classes, _ = grasp_classes(part, HAND)
    assert classes
    for found in classes:
        places, inward = pressed(found), np.array([[-1.0, 0, 0], [1.0, 0, 0]])
        within = apply(found.T_part_plane, places + 1e-4 * inward)
        beyond = apply(found.T_part_plane, places - 1e-4 * inward)
        assert inside(part, within).all() and not inside(part, beyond).any(), found.name
        assert HAND.opening_min <= found.width < HAND.opening_max
        normal = part.solid.normals[found.faces[0]]
        assert np.allclose(found.T_part_plane[:3, 0], normal)


@pytest.mark.parametrize("name", sorted(PARTS))
def test_features_lie_half_the_width_off_the_plane_and_lean_away_from_the_pad(name):
    part, least = PARTS[name], GraspOptions().least_lean
    for found in grasp_classes(part, HAND)[0]:
        local = apply(inverse(found.T_part_plane), part.solid.vertices)
        f, number = found.features
        assert np.allclose(local[list(part.solid.faces[f].outer), 0], found.width / 2, atol=1e-3)
        if found.kind == "faces":
            corners, beside = list(part.solid.faces[number].outer), []
            assert found.contact.area >= HAND.min_contact_area
        elif found.kind == "face and edge":
            edge = part.solid.edges[number]
            corners, beside = [edge.start, edge.end], [edge.left, edge.right]
            assert edge.dihedral > 0 and found.contact.length >= found.least_length > 0
        else:
            corners = [number]
            beside = [k for k, face in enumerate(part.solid.faces) if any(number in loop for loop in face.loops)]
            assert found.contact.geom_type == "Point"
        assert np.allclose(local[corners, 0], -found.width / 2, atol=1e-3)
        for face in beside:
            ring = local[list(part.solid.faces[face].outer)]
            rise = ring[:, 0] + found.width / 2
            assert rise.max() > np.sin(least) * 1e-3, "the face beside the feature rises from the pad"
            assert -part.solid.normals[face] @ part.solid.normals[f] < np.cos(least) + 1e-9


@pytest.mark.parametrize("name", sorted(PARTS))
def test_groups_enter_across_their_edge_and_touch_enough(name):
    part = PARTS[name]
    groups, _ = grasp_groups(part, HAND)
    assert groups
    for group in groups:
        along = np.array([np.cos(group.angle), np.sin(group.angle)])
        side = group.edge[1] - group.edge[0]
        assert abs(side @ along) < 1e-9 * np.linalg.norm(side) + 1e-9
        assert np.isclose((group.point - group.edge[0]) @ along, group.depth) and 0 < group.depth < HAND.finger_length
        assert 0 < group.share < 1 and str(group.edge_number) in group.name
        assert contact_area(group.grasp_class, HAND, group.point, group.angle) >= HAND.min_contact_area


def kinds(name):
    return {found.kind for found in grasp_classes(PARTS[name], HAND)[0]}


def test_square_parts_have_faces_only_and_leaning_ones_edges_and_vertices():
    assert kinds("brick") == kinds("bracket") == kinds("tetromino S") == {"faces"}
    assert kinds("roof") == {"faces", "face and edge"}
    assert "face and vertex" in kinds("pyramid")
    (found,) = [c for c in grasp_classes(PARTS["pyramid"], HAND)[0] if c.kind == "face and vertex"]
    assert found.features[1] == 4 or np.allclose(PARTS["pyramid"].solid.vertices[found.features[1]], (0.004, 0, 0.035))
    assert np.isclose(found.width, 0.035)


def test_holes_and_notches_are_no_contact():
    """A frame's outer faces are whole; its flat ones have a window, and the class across the window's walls is none."""
    frame = PARTS["frame"]
    areas = sorted(round(found.contact.area * 1e6) for found in grasp_classes(frame, HAND)[0] if np.isclose(found.width, 0.025))
    assert areas == [70 * 70 - 40 * 40]
    gaps = [entry for entry in grasp_classes(frame, HAND)[1] if entry.reason and "across a gap" in entry.reason]
    assert len(gaps) == 2 and all(np.isclose(entry.value or 0, -0.04) for entry in gaps)


def test_the_finger_covers_the_edge_or_the_vertex_or_there_is_no_contact():
    for name in ("roof", "pyramid"):
        for group in grasp_groups(PARTS[name], HAND)[0]:
            if group.grasp_class.kind == "faces":
                continue
            touched = shapely.get_coordinates(group.grasp_class.contact)
            away = np.array([np.cos(group.angle), np.sin(group.angle)])
            ahead = ((touched - group.point) @ away).min()
            short = group.point + (ahead - 0.001) * away
            assert contact_area(group.grasp_class, HAND, group.point, group.angle) > 0
            assert contact_area(group.grasp_class, HAND, short, group.angle) == 0.0


def test_a_part_too_big_for_the_hand_falls_with_the_number_and_the_limit():
    classes, entries = grasp_classes(Part("crate", box((0.2, 0.3, 0.25))), HAND)
    assert not classes
    assert rejected_counts(entries) == {"the hand does not open that far": 3}
    assert {round(1e3 * entry.value) for entry in entries if entry.value is not None} == {200, 250, 300}
    assert all(entry.limit is not None and entry.limit < 0.1 for entry in entries)


def test_a_needle_has_too_little_contact():
    groups, entries = grasp_groups(Part("needle", box((0.002, 0.002, 0.1))), HAND)
    assert not groups
    assert set(rejected_counts(entries)) == {"the hand does not open that far", "the fingers find too little contact behind this edge"}


def test_a_flat_plate_is_taken_across_its_edges_only():
    """80 × 60 × 3 mm: the thin sides are too thin to press on, the flat ones are taken from any side."""
    groups, _ = grasp_groups(Part("plate", box((0.08, 0.06, 0.003))), HAND)
    assert {round(1e3 * group.grasp_class.width) for group in groups} <= {3, 60, 80}
    flat = {group.edge_number for group in groups if np.isclose(group.grasp_class.width, 0.003)}
    assert flat == {0, 1, 2, 3}


def test_an_edge_that_leans_too_little_falls_with_its_angle():
    """A nearly flat roof: its ridge leans by 3° to both sides, less than what a pad may bridge."""
    rise = 0.02 * np.tan(np.deg2rad(3.0))
    roof = Part("flat roof", prism([[-0.02, 0.0], [0.02, 0.0], [0.02, 0.02], [0.0, 0.02 + rise], [-0.02, 0.02]], 0.06))
    entries = [entry for entry in grasp_classes(roof, HAND)[1] if entry.reason and "too flat" in entry.reason]
    assert [round(np.rad2deg(entry.value or 0.0)) for entry in entries if "edge" in entry.option].count(3) >= 1
    assert all(entry.limit and np.isclose(np.rad2deg(entry.limit), 5.0) for entry in entries)


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_classes_do_not_hang_on_the_models_frame(seed):
    rng = np.random.default_rng(seed)
    part = PARTS[str(rng.choice(sorted(UNUSUAL)))]
    T = from_xyz_rpy(rng.uniform(-0.1, 0.1, 3), rng.uniform(-np.pi, np.pi, 3))
    moved = Part("moved", Polyhedron(apply(T, part.solid.vertices), part.solid.faces))
    here, there = grasp_classes(part, HAND)[0], grasp_classes(moved, HAND)[0]
    assert [(c.kind, c.features) for c in here] == [(c.kind, c.features) for c in there]
    assert np.allclose([c.width for c in here], [c.width for c in there])
    assert np.allclose([c.contact.area for c in here], [c.contact.area for c in there])
    assert np.allclose([T @ c.T_part_plane for c in here], [c.T_part_plane for c in there])
