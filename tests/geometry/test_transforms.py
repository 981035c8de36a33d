import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse, is_rigid, pose_difference, rotation_about, to_xyz_rpy, transform

angles = st.one_of(st.floats(-np.pi, np.pi), st.sampled_from([0.0, 1e-12, -1e-9, np.pi / 2, np.pi]))
poses = st.builds(from_xyz_rpy, arrays(float, 3, elements=st.floats(-2, 2)), st.tuples(angles, angles, angles))


@given(poses)
def test_inverse_undoes(T):
    assert np.allclose(T @ inverse(T), np.eye(4), atol=1e-12)
    assert is_rigid(T)


@given(poses)
def test_roll_pitch_yaw_round_trip_even_at_gimbal_lock(T):
    assert np.allclose(from_xyz_rpy(*to_xyz_rpy(T)), T, atol=1e-6)


@given(poses, arrays(float, (5, 3), elements=st.floats(-1, 1)))
def test_apply_is_the_homogeneous_product(T, points):
    expected = (T @ np.c_[points, np.ones(5)].T).T[:, :3]
    assert np.allclose(apply(T, points), expected)


@given(st.floats(1e-9, 3.0), arrays(float, 3, elements=st.floats(0.1, 1)))
def test_pose_difference_measures_small_angles_truly(angle, axis):
    T = transform(rotation_about(axis, angle), (0.0, 0.003, 0.004))
    distance, turned = pose_difference(np.eye(4), T)
    assert np.isclose(distance, 0.005) and np.isclose(turned, angle, rtol=1e-6, atol=1e-12)


def test_a_mirror_is_not_rigid():
    assert not is_rigid(np.diag([1.0, 1.0, -1.0, 1.0]))
    assert not is_rigid(np.full((4, 4), np.nan))
