import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron, box
from handey_studio.geometry.transforms import apply, from_xyz_rpy
from handey_studio.modeling.planes import corners_on_planes, inherited
from handey_studio.modeling.solids import combined, cut_by_plane, mirrored, prism_between
from tests.modeling.models import UP, check_solid

BASE = box((0.1, 0.08, 0.04))
SQUARE = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.06, 0], [0, 0.06, 0]])
HOLE = np.array([[0.02, 0.02, 0], [0.04, 0.02, 0], [0.04, 0.04, 0], [0.02, 0.04, 0]])


def at(size, middle, rpy=(0, 0, 0)) -> Polyhedron:
    solid = box(size)
    return Polyhedron(apply(from_xyz_rpy(middle, rpy), solid.vertices), solid.faces)


def inside(solid: Polyhedron, points: np.ndarray) -> np.ndarray:
    return np.all(points @ solid.normals.T - solid.offsets <= 0, axis=1)


@settings(max_examples=25)
@given(
    st.tuples(*[st.floats(0.02, 0.12)] * 3),
    st.tuples(*[st.floats(-0.05, 0.05)] * 3),
    st.tuples(*[st.sampled_from([0.0, 0.3, -1.1])] * 3),
    st.sampled_from(["join", "cut", "common"]),
)
def test_booleans_hold_what_points_say(size, middle, rpy, how):
    """Against an oracle that only counts random points in both convex solids."""
    tool = at(size, middle, rpy)
    try:
        solid = combined(BASE, tool, how)
    except BadInput as error:
        assert str(error).endswith(".")
        return
    check_solid(solid)
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (20_000, 3))
    a, b = inside(BASE, points), inside(tool, points)
    share = {"join": a | b, "cut": a & ~b, "common": a & b}[how].mean()
    assert abs(solid.volume_and_centroid[0] / 0.4**3 - share) < 5 * np.sqrt(share / 20_000) + 1e-4


def test_every_face_of_a_result_lies_exactly_in_a_plane_of_what_it_was_made_of():
    tool = at((0.05, 0.05, 0.05), (0.04, 0.03, 0.02), (0.2, 0.3, 0.4))
    solid = combined(BASE, tool, "cut")
    normals, offsets = np.vstack([BASE.normals, tool.normals]), np.append(BASE.offsets, tool.offsets)
    for face in solid.faces:
        corners = solid.vertices[[c for loop in face.loops for c in loop]]
        assert np.abs(corners @ normals.T - offsets).max(axis=0).min() < 1e-15


@pytest.mark.parametrize("gap", [0.0, 1e-9, 1e-6, 1e-5, -1e-6])
def test_faces_that_are_meant_to_be_flush_are(gap):
    joined = combined(BASE, at((0.05, 0.08, 0.04), (0.025, 0, 0.04 + gap)), "join")
    check_solid(joined)
    assert len(joined.faces) == 8 and len(joined.vertices) == 12
    assert len(combined(BASE, at((0.1, 0.08, 0.04), (0, 0, 0.04 + gap)), "join").faces) == 6


@settings(max_examples=12)
@given(st.integers(0, 10_000))
def test_flush_bodies_meet_wherever_they_stand(seed):
    """Bodies on a grid of 10 mm, so that faces, edges and corners coincide, turned anywhere: the same as on the grid."""
    rng = np.random.default_rng(seed)
    T = from_xyz_rpy(rng.uniform(-0.3, 0.3, 3), rng.uniform(-3, 3, 3))
    straight = turned = None
    for _ in range(4):
        low = rng.integers(0, 4, 3)
        size = rng.integers(1, 4, 3)
        body = at(0.01 * size, 0.01 * (low + 0.5 * size))
        how = "join" if straight is None else ("join", "join", "cut")[rng.integers(3)]
        straight, reason = outcome(straight, body, how)
        turned, reason_turned = outcome(turned, Polyhedron(apply(T, body.vertices), body.faces), how)
        assert (reason is None) == (reason_turned is None), (reason, reason_turned)
        assert len(straight.faces) == len(turned.faces) and len(straight.vertices) == len(turned.vertices)
        assert_allclose(turned.volume_and_centroid[0], straight.volume_and_centroid[0], rtol=1e-9)
        assert_allclose(apply(T, straight.volume_and_centroid[1]), turned.volume_and_centroid[1], atol=1e-9)
        check_solid(turned)


def outcome(solid: Polyhedron | None, body: Polyhedron, how: str) -> tuple[Polyhedron, str | None]:
    """The solid after a boolean, or as it was with the reason."""
    if solid is None:
        return body, None
    try:
        return combined(solid, body, how), None
    except BadInput as error:
        return solid, str(error)


@pytest.mark.parametrize(
    ("tool", "how", "match"),
    [
        (at((0.05, 0.05, 0.05), (0.1, 0.2, 0)), "join", "do not touch, they are 137.3 mm apart"),
        (at((0.05, 0.05, 0.05), (0.075, 0.065, 0)), "join", "only touch along an edge at"),
        (at((0.02, 0.02, 0.02), (0, 0, 0)), "join", "wholly inside the solid; nothing would change"),
        (at((0.02, 0.02, 0.02), (0, 0, 0)), "cut", "a hollow of 8 cm³ inside"),
        (at((0.02, 0.2, 0.2), (0, 0, 0)), "cut", "2 separate bodies, of 128 cm³ and 128 cm³"),
        (at((0.2, 0.2, 0.2), (0, 0, 0)), "cut", "would leave nothing"),
        (at((0.2, 0.2, 0.2), (0, 0.5, 0)), "cut", "does not touch the solid"),
        (at((0.2, 0.2, 0.2), (0, 0.5, 0)), "common", "nothing in common"),
        (at((0.2, 0.2, 0.2), (0, 0, 0)), "common", "nothing would change"),
        (at((0.05, 0.08, 0.04), (0.025, 5e-5, 0.03)), "join", "a sliver 0.05 mm wide"),
    ],
)
def test_what_makes_no_part_is_refused_with_one_sentence(tool, how, match):
    with pytest.raises(BadInput, match=match):
        combined(BASE, tool, how)


def test_a_hole_through_a_box_is_a_hole_in_two_faces():
    tube = combined(BASE, at((0.02, 0.03, 0.06), (0, 0, 0)), "cut")
    check_solid(tube)
    assert sorted(len(face.holes) for face in tube.faces) == [0] * 8 + [1] * 2
    labels = inherited(tube, [(BASE, ["base"] * 6), (at((0.02, 0.03, 0.06), (0, 0, 0)), ["tool"] * 6)], "?")
    assert sorted(labels) == ["base"] * 6 + ["tool"] * 4


@settings(max_examples=25)
@given(st.tuples(*[st.floats(-1, 1)] * 3), st.floats(-0.04, 0.04))
def test_the_two_halves_of_a_cut_fill_the_whole(direction, place):
    normal = np.array(direction) + np.array([0, 0, 1e-3])
    normal = normal / np.linalg.norm(normal)
    try:
        halves = [cut_by_plane(BASE, place * normal, sign * normal) for sign in (1, -1)]
    except BadInput:
        return
    for half, sign in zip(halves, (1, -1), strict=True):
        check_solid(half)
        assert ((half.vertices @ normal - place) * sign).max() < 1e-12
    assert_allclose(sum(half.volume_and_centroid[0] for half in halves), 0.1 * 0.08 * 0.04, rtol=1e-9)


@pytest.mark.parametrize(
    ("z", "up", "match"), [(0.02, 1, "does not pass"), (-0.02, 1, "cut off the whole"), (0.5, -1, "cut off the whole")]
)
def test_cuts_that_do_nothing_or_all_are_refused(z, up, match):
    with pytest.raises(BadInput, match=match):
        cut_by_plane(BASE, (0, 0, z), (0, 0, up))


def test_a_cut_along_a_face_leaves_no_film():
    stair = combined(BASE, at((0.05, 0.08, 0.04), (0.025, 0, 0.04)), "join")
    moved = Polyhedron(stair.vertices + 0.1 / 3, stair.faces)
    for point, normal in (((0, 0, 0.02), (0, 0, 1)), ((0, 0, 0), (-1, 0, 0)), ((0, 0, 0), (1, 0, 0))):
        half = cut_by_plane(moved, np.array(point) + 0.1 / 3, normal)
        check_solid(half)
        assert len(half.faces) == 6


def test_a_mirror_image_twice_is_the_solid():
    solid = combined(BASE, at((0.05, 0.05, 0.05), (0.04, 0.03, 0.02)), "cut")
    image = mirrored(solid, (0.3, 0.2, 0.1), (1, 2, 3))
    check_solid(image)
    assert_allclose(mirrored(image, (0.3, 0.2, 0.1), (1, 2, 3)).vertices, solid.vertices, atol=1e-15)
    assert_allclose(image.volume_and_centroid[0], solid.volume_and_centroid[0])


def test_prisms_reach_to_a_plane_up_and_down_with_holes():
    for offset in (0.05, -0.05):
        straight = prism_between([SQUARE, HOLE], UP, UP, offset)
        check_solid(straight)
        assert_allclose(straight.volume_and_centroid[0], (0.1 * 0.06 - 0.02 * 0.02) * 0.05)
    lean = np.array([0, 0.6, 0.8])
    trimmed = prism_between([SQUARE], UP, lean, 0.08)
    check_solid(trimmed)
    assert_allclose(trimmed.volume_and_centroid[0], 0.1 * 0.06 * (0.08 - 0.6 * 0.03) / 0.8)


@pytest.mark.parametrize(
    ("normal", "offset", "match"),
    [
        ((0, 0, 1), 0.0, "no height"),
        ((0, 0.6, 0.8), 0.02, "crosses the outline"),
        ((1, 0, 0), 0.2, "runs along the extrusion"),
        ((0, 0, 1), 5.0, "5000 mm long, the limit is 3000 mm"),
    ],
)
def test_prisms_to_nowhere_are_refused(normal, offset, match):
    with pytest.raises(BadInput, match=match):
        prism_between([SQUARE], UP, np.array(normal, dtype=float), offset)


def test_a_hole_that_leaves_its_outline_is_refused():
    with pytest.raises(BadInput, match="would cross itself"):
        prism_between([SQUARE, HOLE + np.array([0.07, 0, 0])], UP, UP, 0.05)


def test_four_faces_at_a_corner_do_not_come_apart_unseen():
    pyramid = Polyhedron(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]]) * 0.1, PYRAMID_FACES)
    assert_allclose(corners_on_planes(pyramid, pyramid.normals, pyramid.offsets), pyramid.vertices, atol=1e-15)
    with pytest.raises(BadInput, match=r"4 faces that meet at the corner \(50.0, 50.0, 100.0\) mm would come apart"):
        corners_on_planes(pyramid, pyramid.normals, pyramid.offsets + np.array([0, 0.01, 0, 0, 0]))


PYRAMID_FACES = tuple(type(BASE.faces[0])(loop) for loop in ((3, 2, 1, 0), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)))
