import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron, box, prism
from handey_studio.geometry.transforms import apply, from_xyz_rpy, rotate
from handey_studio.modeling.editing import moved_corner, moved_edge, moved_face, with_angle, with_distance, with_length
from handey_studio.modeling.lookup import corner_at, edge_at, face_at, reference_to_face
from handey_studio.modeling.picking.measuring import measure
from handey_studio.modeling.references import CornerAt, EdgeAt, FaceAt
from handey_studio.modeling.solids import combined
from handey_studio.world.library import Library
from tests.modeling.models import check_solid

POSE = from_xyz_rpy((0.1, -0.2, 0.3), (0.3, -0.5, 1.0))


def posed(solid: Polyhedron, T: np.ndarray) -> Polyhedron:
    return Polyhedron(apply(T, solid.vertices), solid.faces)


def stair() -> Polyhedron:
    """100 × 80 mm, 40 mm high where x < 0 and 80 mm where x > 0; its foot at z = −20 mm."""
    step = box((0.05, 0.08, 0.04))
    return combined(box((0.1, 0.08, 0.04)), Polyhedron(step.vertices + np.array([0.025, 0, 0.04]), step.faces), "join")


def face(solid: Polyhedron, point, normal) -> int:
    return face_at(solid, FaceAt(np.array(point, dtype=float), np.array(normal, dtype=float)))


@settings(max_examples=25)
@given(st.sampled_from(["l_block", "wedge", "stairs", "brick", "t_block", "bracket"]), st.integers(0, 100), st.floats(-0.03, 0.03))
def test_a_moved_face_goes_exactly_as_far_and_no_other_moves(name, number, distance):
    solid = posed(Library.choose(None).part(name).solid, POSE)
    f = number % len(solid.faces)
    try:
        change = moved_face(solid, f, distance)
    except BadInput as error:
        assert "the limit is" in str(error) or "would not move" in str(error)
        return
    check_solid(change.solid)
    expected = solid.offsets + distance * (np.arange(len(solid.faces)) == f)
    for g, was in enumerate(change.came_from):
        assert_allclose(change.solid.normals[g], solid.normals[was], atol=1e-9)
        assert_allclose(change.solid.offsets[g], expected[was], atol=1e-9)


@pytest.mark.parametrize("pose", [np.eye(4), POSE], ids=["straight", "turned"])
def test_the_limit_of_a_move_is_where_an_edge_ends(pose):
    """A roof of 45 mm over a trapezium: its flat top can rise until it is a ridge."""
    solid = posed(prism(np.array([[0, 0], [0.1, 0], [0.08, 0.03], [0.02, 0.03]]), 0.05), pose)
    top = face_at(solid, FaceAt(apply(pose, (0.05, 0.03, 0.02)), rotate(pose, (0, 1, 0))))
    with pytest.raises(BadInput, match=r"the face cannot move by 60 mm that way, the limit is 45 mm: the edge at .* turn round"):
        moved_face(solid, top, 0.06)
    ridge = moved_face(solid, top, 0.045).solid
    check_solid(ridge)
    assert len(ridge.faces) == 5
    assert_allclose(ridge.volume_and_centroid[0], 0.5 * 0.1 * 0.075 * 0.05, rtol=1e-9)
    with pytest.raises(BadInput, match=r"the limit is 29\.[89]\d? mm: nothing would be left"):
        moved_face(solid, top, -0.03)


@pytest.mark.parametrize("pose", [np.eye(4), POSE], ids=["straight", "turned"])
def test_the_low_side_of_a_step_grows_past_the_high_one(pose):
    solid = posed(stair(), pose)
    low = face_at(solid, FaceAt(apply(pose, (-0.025, 0, 0.02)), rotate(pose, (0, 0, 1))))
    for height, faces in ((0.039, 8), (0.04, 6), (0.06, 8)):
        change = moved_face(solid, low, height)
        check_solid(change.solid)
        assert len(change.solid.faces) == faces
        assert_allclose(change.solid.volume_and_centroid[0], 0.05 * 0.08 * (0.08 + 0.04 + height))
    raised = change.came_from.index(low)
    assert_allclose(change.solid.offsets[raised], solid.offsets[low] + 0.06)
    assert set(change.came_from) == set(range(8)) and len(change.came_from) == 8
    with pytest.raises(BadInput, match=r"the limit is 39\.[89]"):
        moved_face(solid, low, -0.06)


def test_walls_that_meet_fill_the_slot_and_go_no_farther():
    u = prism(np.array([[0, 0], [0.1, 0], [0.1, 0.06], [0.07, 0.06], [0.07, 0.02], [0.03, 0.02], [0.03, 0.06], [0, 0.06]]), 0.05)
    inner = face(u, (0.03, 0.04, 0.025), (1, 0, 0))
    check_solid(moved_face(u, inner, 0.0395).solid)
    assert len(moved_face(u, inner, 0.04).solid.faces) == 6
    with pytest.raises(BadInput, match=r"the limit is 39\.[89]"):
        moved_face(u, inner, 0.05)


def test_edges_and_corners_go_where_they_are_dragged_and_right_angles_stay():
    solid = stair()
    edge, end = edge_at(solid, EdgeAt(np.array([0.05, 0.04, 0.02]), np.array([0, 0, 1.0])))
    dragged = moved_edge(solid, edge, (0.01, -0.02, 0.5)).solid
    check_solid(dragged)
    assert_allclose(dragged.vertices[end], [0.06, 0.02, 0.06], atol=1e-12)
    corner = moved_corner(solid, corner_at(solid, CornerAt(np.array([0.05, 0.04, 0.06]))), (0.01, -0.02, 0.03)).solid
    check_solid(corner)
    assert_allclose(corner.vertices.max(axis=0), [0.06, 0.02, 0.09], atol=1e-12)
    for changed in (dragged, corner):
        assert_allclose([abs(abs(e.dihedral) - np.pi / 2) for e in changed.edges], 0.0, atol=1e-12)


def test_typed_dimensions_are_exact():
    solid = posed(stair(), POSE)
    places = (((0.02, 0, 0.06), (0, 0, 1)), ((0, 0, -0.02), (0, 0, -1)), ((-0.02, 0, 0.02), (0, 0, 1)), ((0, 0, 0.04), (-1, 0, 0)))
    top, foot, low, inner = (face(solid, apply(POSE, point), rotate(POSE, normal)) for point, normal in places)
    taller = with_distance(solid, top, foot, 0.1234).solid
    assert_allclose(taller.offsets[top] + taller.offsets[foot], 0.1234, atol=1e-12)
    step = with_distance(solid, low, top, 0.025).solid
    assert_allclose(step.offsets[top] - step.offsets[low], 0.025, atol=1e-12)
    edge, end = edge_at(solid, EdgeAt(apply(POSE, (0.05, 0.04, 0.02)), rotate(POSE, (0, 0, -1))))
    long = with_length(solid, edge, end, 0.0951).solid
    check_solid(long)
    assert_allclose(np.linalg.norm(long.vertices[edge.start] - long.vertices[edge.end]), 0.0951, atol=1e-12)
    for degrees in (100.0, 170.0, 61.5, 90.5):
        for f, other in ((inner, low), (low, inner)):
            try:
                lean = with_angle(solid, f, other, np.deg2rad(degrees)).solid
            except BadInput as error:
                assert "the limit is" in str(error)
                assert (f, degrees) != (inner, 100.0), "a lean of ten degrees is possible"
                continue
            check_solid(lean)
            shared = next(e for e in lean.edges if {e.left, e.right} == {f, other})
            assert_allclose(np.pi + shared.dihedral, np.deg2rad(degrees), atol=1e-9)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda s: with_distance(s, 0, 1, 0.1), "90 ° from parallel"),
        (lambda s: with_distance(s, 0, 0, 0.1), "one and the same"),
        (lambda s: with_angle(s, 0, 0, 1.0), "do not meet at an edge"),
        (lambda s: moved_face(s, 0, 0.0), "nothing would change"),
        (lambda s: moved_face(s, 0, -5.0), "the limit is"),
        (lambda s: moved_corner(s, 0, (0, 0, 0)), "nothing would change"),
    ],
)
def test_changes_that_make_no_sense_are_refused(change, match):
    solid = stair()
    order = [face(solid, (0, 0, -0.02), (0, 0, -1)), face(solid, (0, 0.04, 0), (0, 1, 0))]
    order += [f for f in range(len(solid.faces)) if f not in order]
    with pytest.raises(BadInput, match=match):
        change(Polyhedron(solid.vertices, tuple(solid.faces[f] for f in order)))


@settings(max_examples=15)
@given(st.integers(0, 1000), st.floats(0, 0.004), st.floats(0, 0.1))
def test_a_face_is_found_again_by_a_rough_reference(seed, off, turn):
    solid = stair()
    rng = np.random.default_rng(seed)
    f = int(rng.integers(len(solid.faces)))
    exact = reference_to_face(solid, f)
    rough = FaceAt(exact.point + off * rng.normal(size=3) / 2, exact.normal + turn * rng.normal(size=3) / 2)
    assert face_at(solid, rough) == f


def test_a_reference_to_nothing_says_so():
    solid = stair()
    with pytest.raises(BadInput, match=r"the face that is meant at \(0.0, 0.0, 0.0\) mm is not there"):
        face(solid, (0, 0, 0), (1, 1, 1))
    with pytest.raises(BadInput, match=r"the corner .* is not there; the nearest is .* mm off; pick it again"):
        corner_at(solid, CornerAt(np.array([1.0, 0, 0])))


def test_measures_between_all_kinds_of_picks():
    plane, line, point = (
        FaceAt(np.array([0, 0, 0.1]), np.array([0, 0, 1.0])),
        EdgeAt(np.array([0.0, 0, 0.3]), np.array([1.0, 0, 0])),
        CornerAt(np.array([0.5, 0.4, 0])),
    )
    tilted = FaceAt(np.array([0, 0, 0.2]), np.array([0, 0.6, 0.8]))
    assert measure(point, plane).sentence == measure(plane, point).sentence == "the distance is 100 mm"
    assert_allclose(measure(line, point).value, 0.5)
    assert_allclose(measure(plane, line).value, 0.2)
    assert_allclose(measure(point, CornerAt(np.array([0.5, 0, 0.3]))).value, 0.5)
    assert measure(plane, tilted).sentence == "the angle is 36.9 °"
    assert measure(EdgeAt(np.zeros(3), np.array([0, 1.0, 1])), plane).sentence == "the angle is 45 °"
    assert measure(plane, FaceAt(np.array([0, 0, -0.1]), np.array([0, 0, -1.0]))).sentence == "the distance is 200 mm"
