"""What is shown of a pose: predicted edges, residuals and Figure 3, against truth and against slower ways to the same numbers."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handey_studio.geometry import box
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse, transform
from handey_studio.localization import LocateOptions
from handey_studio.localization.edge_pair import edge_pair
from handey_studio.localization.explain import FOUND, HIDDEN, MAX_READINGS, MISSING, explain
from handey_studio.localization.pairs import model_edges
from handey_studio.localization.samples import part_samples
from handey_studio.localization.search import look
from handey_studio.localization.verify import ENDS_WORTH, verify
from handey_studio.world import Part
from tests.localization.rendering import map_from_above

BRICK = Part("brick", box((0.08, 0.05, 0.04)))
SLAB = Part("slab", box((0.16, 0.12, 0.03)))
CUBE = Part("cube", box((0.03, 0.03, 0.03)))
STANDING = from_xyz_rpy((0.45, 0.05, 0.02), (0.0, 0.0, 0.4))


@pytest.fixture(scope="module")
def brick_view():
    return map_from_above([(BRICK.solid, STANDING)], np.random.default_rng(1)).view()


def in_sensor(view, T_world_part):
    return inverse(view.T_world_sensor) @ T_world_part


def test_at_the_truth_the_outline_is_found_and_readings_lie_on_the_part(brick_view):
    said = explain(brick_view, BRICK, in_sensor(brick_view, STANDING))
    found, missing, hidden = said.lengths_m
    assert found == pytest.approx(2 * (0.08 + 0.05), rel=0.05) and missing < 0.01
    assert found + missing + hidden == pytest.approx(4 * (0.08 + 0.05 + 0.04))
    assert said.edges.sum() == 12 and said.edges[FOUND] == 4 and said.edges[MISSING] == 0
    assert 0.0002 < said.rms_m < 0.0006, "the readings' noise is 0.4 mm"
    assert np.abs(said.readings_world[:, 2] - 0.04).max() < 0.003 and said.surface_shares[0] > 0.98
    assert set(said.state[said.pieces_world[..., 2].max(axis=1) < 0.001]) == {HIDDEN}, "nothing is seen of its lower edges"


@pytest.mark.parametrize("lift_mm", [-1.0, 1.0])
def test_a_pose_that_is_off_leaves_its_error_in_the_residuals_with_its_sign(brick_view, lift_mm):
    T = transform(translation=(0.0, 0.0, lift_mm / 1e3)) @ STANDING
    said = explain(brick_view, BRICK, in_sensor(brick_view, T))
    assert np.median(said.distance) == pytest.approx(-lift_mm / 1e3, abs=1e-4), "readings before the model are positive"


def test_a_small_box_laid_inside_a_bigger_face_misses_its_edges():
    slab_at = from_xyz_rpy((0.48, 0.02, 0.015))
    view = map_from_above([(SLAB.solid, slab_at)], np.random.default_rng(2)).view()
    said = explain(view, CUBE, in_sensor(view, from_xyz_rpy((0.48, 0.02, 0.015))))
    assert said.lengths_m[MISSING] == pytest.approx(0.12, rel=0.02) and said.lengths_m[FOUND] == 0.0
    assert said.surface_shares[0] > 0.95, "the surfaces agree all the same"


def test_what_lies_under_another_part_is_hidden_and_what_floats_is_seen_through():
    over = from_xyz_rpy((0.48, 0.02, 0.055))
    view = map_from_above([(SLAB.solid, over)], np.random.default_rng(3)).view()
    under = explain(view, CUBE, in_sensor(view, from_xyz_rpy((0.48, 0.02, 0.015))))
    assert under.edges.tolist() == [0, 0, 12] and len(under.distance) == 0 and under.rms_m is None
    assert under.surface_shares[2] == 1.0
    nothing = explain(view, CUBE, in_sensor(view, from_xyz_rpy((0.62, -0.12, 0.015))))
    assert nothing.surface_shares[1] == 1.0 and np.median(nothing.distance) == pytest.approx(-0.03, abs=5e-4), "its base is no surface seen"
    above = explain(view, CUBE, in_sensor(view, from_xyz_rpy((0.48, 0.02, 0.165))))
    assert above.surface_shares[1] == 1.0 and above.distance.max() < -0.05 and above.rms_m is None


def test_distances_are_those_to_the_nearest_point_of_the_faces_seen(brick_view):
    T = STANDING @ from_xyz_rpy((0.004, -0.003, 0.006), (0.2, -0.15, 0.3))
    said = explain(brick_view, BRICK, in_sensor(brick_view, T))
    assert len(said.distance) > 500
    mesh = trimesh.Trimesh(apply(T, BRICK.solid.vertices), BRICK.solid.triangles, process=False)
    looking_up = mesh.submesh([np.nonzero(mesh.face_normals[:, 2] > 0.12)[0]], append=True)
    _, slow, _ = trimesh.proximity.closest_point_naive(looking_up, said.readings_world[::7])
    np.testing.assert_allclose(np.abs(said.distance[::7]), slow, atol=1e-9)
    inside = mesh.ray.contains_points(said.readings_world[::7])
    clear = slow > 1e-6
    behind = said.distance[::7] < 0.0
    assert (behind | ~inside)[clear].all(), "a reading inside the model lies behind its surface"


def test_a_look_at_hand_gives_the_same_and_readings_are_bounded(brick_view):
    search = look(brick_view, LocateOptions())
    T = in_sensor(brick_view, STANDING)
    assert explain(brick_view, BRICK, T, search=search) == explain(brick_view, BRICK, T)
    table = Part("table", box((0.39, 0.39, 0.02)))
    said = explain(brick_view, table, in_sensor(brick_view, from_xyz_rpy((0.48, 0.0, -0.01))), search=search)
    assert 0.5 * MAX_READINGS < len(said.distance) <= MAX_READINGS


def test_edges_are_counted_and_measured_as_the_verifier_does(brick_view):
    search, samples = look(brick_view, LocateOptions()), part_samples(BRICK)
    for shift in ((0.0, 0.0, 0.0), (0.012, 0.0, 0.0), (0.03, 0.02, 0.002)):
        T = in_sensor(brick_view, transform(translation=shift) @ STANDING)
        said = explain(brick_view, BRICK, T, search=search)
        verdict = verify(T[None, :3, :3], T[None, :3, 3], samples, search.evidence, search.limits)
        assert said.edges[FOUND] == verdict.edges[0] and said.edges[FOUND] + said.edges[MISSING] == verdict.predicted[0]
        found, missing, _ = said.lengths_m
        assert found - (1.0 - ENDS_WORTH) * said.ragged_m == pytest.approx(verdict.found[0]) and missing == pytest.approx(
            verdict.missing[0]
        )


def test_figure_3_of_data_edges_is_that_of_the_model_edges_they_come_from(brick_view):
    edges = look(brick_view, LocateOptions()).edges
    T = in_sensor(brick_view, STANDING)
    table = model_edges(BRICK)
    middle = apply(T, table.middle)
    top = [int(np.argmin(np.linalg.norm(middle - edge.ends_sensor.mean(axis=0), axis=1))) for edge in edges]
    pairs = [(i, j) for i in range(len(edges)) for j in range(i) if abs(table.direction[top[i]] @ table.direction[top[j]]) < 0.5]
    assert pairs
    for i, j in pairs:
        said = explain(brick_view, BRICK, T, (edges[i], edges[j]), (top[i], top[j]))
        assert said.data_pair is not None and said.model_pair is not None
        assert said.data_pair.alpha == pytest.approx(said.model_pair.alpha, abs=np.deg2rad(3.0))
        assert said.data_pair.d == pytest.approx(said.model_pair.d, abs=0.002)
        np.testing.assert_allclose(said.data_pair.a, said.model_pair.a, atol=0.004)
        np.testing.assert_allclose(said.data_pair.feet, said.model_pair.feet, atol=0.004)
    alone = explain(brick_view, BRICK, T, (edges[0], edges[1]))
    assert alone.model_pair is None and alone.data_pair is not None
    assert explain(brick_view, BRICK, T).data_pair is None


ENDS = st.lists(st.floats(-0.2, 0.2), min_size=12, max_size=12).map(lambda x: np.array(x).reshape(2, 2, 3))


def skew(ends):
    along = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    return lengths.min() > 0.01 and np.linalg.norm(np.cross(along[0] / lengths[0], along[1] / lengths[1])) > 0.43


@given(ENDS.filter(skew), st.integers(0, 2**31 - 1))
@settings(max_examples=150, deadline=None)
def test_figure_3_is_what_the_paper_defines(ends, seed):
    pair = edge_pair(ends)
    across = pair.feet[1] - pair.feet[0]
    along = (ends[:, 1] - ends[:, 0]) / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
    np.testing.assert_allclose(along @ across, 0.0, atol=1e-8)
    assert np.linalg.norm(across) == pytest.approx(abs(pair.d), abs=1e-9)
    np.testing.assert_allclose(np.cross(pair.feet - ends[:, 0], along), 0.0, atol=1e-8)
    for k in range(2):
        gaps = np.linalg.norm(ends[k] - pair.feet[k], axis=1)
        assert pair.a[k] == pytest.approx(gaps.min(), abs=1e-9)
        assert np.linalg.norm(pair.nearest[k] - pair.feet[k]) == pytest.approx(pair.a[k], abs=1e-9)
    arc = pair.arc(0.02)
    np.testing.assert_allclose(np.linalg.norm(arc - pair.feet[0], axis=1), 0.02)
    np.testing.assert_allclose(arc[[0, -1]] - pair.feet[0], 0.02 * pair.directions, atol=1e-9)
    T = transform(Rotation.random(None, np.random.default_rng(seed)).as_matrix(), (0.3, -0.2, 0.1))
    moved, swapped = edge_pair(apply(T, ends)), edge_pair(ends[:, ::-1], pair.directions)
    mirrored = edge_pair(ends * (1.0, 1.0, -1.0))
    for other, d in ((moved, pair.d), (swapped, pair.d), (mirrored, -pair.d)):
        np.testing.assert_allclose((other.alpha, other.d, *other.a), (pair.alpha, d, *pair.a), atol=1e-8)


@given(st.floats(-0.2, 0.2), st.integers(0, 2**31 - 1))
@settings(max_examples=40, deadline=None)
def test_parallel_edges_have_a_distance_and_no_bases(tilt, seed):
    ends = np.array(
        [[[-0.04, 0.0, 0.0], [0.04, 0.0, 0.0]], [[0.06, 0.05, 0.01], [0.06 + 0.05 * np.cos(tilt), 0.05 + 0.05 * np.sin(tilt), 0.01]]]
    )
    T = transform(Rotation.random(None, np.random.default_rng(seed)).as_matrix(), (0.3, -0.2, 0.1))
    for pair in (edge_pair(apply(T, ends)), edge_pair(apply(T, ends[:, ::-1])), edge_pair(apply(T, ends), T[:3, 0] * np.ones((2, 1)))):
        assert pair.parallel and pair.alpha == pytest.approx(abs(tilt), abs=1e-6)
        assert np.linalg.norm(pair.feet[1] - pair.feet[0]) == pytest.approx(pair.d) and pair.d > 0.0
        assert set(pair.anchors(0.01)) == {"α", "d"}
    if abs(tilt) < 1e-9:
        assert pair.d == pytest.approx(np.hypot(0.05, 0.01))


def test_names_stand_apart_even_at_a_shared_corner():
    corner = np.array([[[0, 0, 0], [0.05, 0, 0]], [[0, 0, 0], [0, 0.04, 0]]], dtype=float)
    at = np.array(list(edge_pair(corner).anchors(0.01).values()))
    gaps = np.linalg.norm(at[:, None] - at[None], axis=2)[np.triu_indices(4, 1)]
    assert gaps.min() > 0.009
