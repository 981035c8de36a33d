"""The relative pose of two edges against definitions and against minimisation."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from handey_studio.geometry.lines import nearest_end, relative_pose

number = st.floats(-1.0, 1.0)
vector = st.tuples(number, number, number).map(np.array)
direction = vector.filter(lambda v: np.linalg.norm(v) > 0.1).map(lambda v: v / np.linalg.norm(v))
nearly = st.sampled_from([0.0, 1e-9, 1e-5, 1e-3])


@given(vector, direction, vector, direction)
def test_the_common_perpendicular_is_perpendicular_to_both_and_d_long(p1, e1, p2, e2):
    pose = relative_pose(p1, e1, p2, e2)
    if np.sin(pose.alpha) < 1e-3:
        return
    foot1, foot2 = p1 + pose.foot1 * e1, p2 + pose.foot2 * e2
    across = foot2 - foot1
    assert abs(across @ e1) < 1e-6 and abs(across @ e2) < 1e-6
    assert np.isclose(np.linalg.norm(across), abs(pose.d), atol=1e-6)
    assert np.isclose(across @ np.cross(e1, e2), pose.d * np.sin(pose.alpha), atol=1e-6)


@given(vector, direction, vector, direction)
def test_turning_a_line_round_changes_alpha_d_and_its_foot_as_said(p1, e1, p2, e2):
    pose, turned = relative_pose(p1, e1, p2, e2), relative_pose(p1, -e1, p2, e2)
    if np.sin(pose.alpha) < 1e-3:
        return
    assert np.isclose(turned.alpha, np.pi - pose.alpha)
    assert np.allclose([turned.d, turned.foot1, turned.foot2], [-pose.d, -pose.foot1, pose.foot2], atol=1e-7)


@given(vector, direction, vector, direction, st.integers(0, 1000))
def test_a_rigid_motion_changes_nothing(p1, e1, p2, e2, seed):
    R = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    shift = np.array([0.3, -0.2, 0.5])
    before = relative_pose(p1, e1, p2, e2)
    after = relative_pose(R @ p1 + shift, R @ e1, R @ p2 + shift, R @ e2)
    assert np.isclose(before.alpha, after.alpha, atol=1e-7)
    if np.sin(before.alpha) > 1e-3:
        assert np.allclose([before.d, before.foot1, before.foot2], [after.d, after.foot1, after.foot2], atol=1e-5)


@given(vector, direction, vector, nearly)
def test_near_parallel_lines_give_finite_numbers(p1, e1, p2, bend):
    e2 = e1 + bend * np.array([0.3, -0.5, 0.7])
    e2 /= np.linalg.norm(e2)
    pose = relative_pose(p1, e1, p2, e2)
    assert np.isfinite([pose.alpha, pose.d, pose.foot1, pose.foot2]).all()
    if bend == 0.0:
        between = p2 - p1
        assert np.isclose(pose.d, np.linalg.norm(between - (between @ e1) * e1), atol=1e-7)


def test_d_is_the_least_distance_that_an_optimiser_finds():
    rng = np.random.default_rng(1)
    for _ in range(10):
        p1, p2 = rng.normal(size=(2, 3))
        e1, e2 = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        found = minimize(lambda s, p1=p1, p2=p2, e1=e1, e2=e2: np.sum((p1 + s[0] * e1 - p2 - s[1] * e2) ** 2), [0.0, 0.0], tol=1e-14)
        pose = relative_pose(p1, e1, p2, e2)
        assert np.isclose(np.sqrt(found.fun), abs(pose.d), atol=1e-5)
        assert np.allclose(found.x, [pose.foot1, pose.foot2], atol=1e-3)


def test_nearest_end_of_a_foot_inside_and_outside_its_edge():
    assert np.allclose(nearest_end(np.array([0.0, 0.3, 1.5, -2.0]), -1.0, 1.0), [1.0, 0.7, 0.5, 1.0])
