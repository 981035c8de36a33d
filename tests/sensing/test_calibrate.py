"""Calibration from corners and stripes that are computed, not photographed: truth comes back, and what is not determined is told."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import apply, inverse, pose_difference, transform
from handey_studio.sensing.stripes.board import Board, fit_camera, place_boards
from handey_studio.sensing.stripes.board_stripes import on_board
from handey_studio.sensing.stripes.calibrate import laser_plane
from handey_studio.sensing.stripes.laser_planes import distances, plane_through
from handey_studio.sensing.stripes.rig_frames import one_step, range_frame
from handey_studio.sensing.stripes.stripe_camera import StripeCamera

CAMERA = StripeCamera(
    np.eye(4), focal_px=1100.0, width=800, height=600, aspect=1.01, centre_px=(391.0, 310.0), distortion=(-0.12, 0.06, 0.0005, -0.0005, 0.0)
)
BOARD = Board(9, 6, 0.02)
PLANE = plane_through((0.9, 0.05, 0.43), (0.02, 0.0, 0.55))  # a laser beside the camera that leans across its view


def board_pose(turn, place) -> np.ndarray:
    """T_camera_board of a board whose middle is at a place, turned (rotation vector) from facing the camera."""
    R = Rotation.from_rotvec(turn).as_matrix()
    return transform(R, np.asarray(place) - R @ BOARD.corners.mean(axis=0))


POSES = [
    board_pose(turn, place)
    for turn, place in (
        ((0.0, 0.0, 0.1), (0.0, 0.0, 0.60)),
        ((0.5, 0.0, 0.0), (0.02, 0.01, 0.52)),
        ((-0.5, 0.1, 0.0), (-0.03, 0.02, 0.58)),
        ((0.0, 0.5, 0.2), (0.03, -0.02, 0.50)),
        ((0.1, -0.5, 0.0), (-0.02, -0.03, 0.62)),
        ((0.3, 0.4, -0.3), (0.0, 0.03, 0.55)),
    )
]


def seen(T, rng, noise=0.05) -> np.ndarray:
    return CAMERA.project(apply(T, BOARD.corners)) + rng.normal(0.0, noise, (54, 2))


def stripe_on(T, rng, noise=0.05) -> np.ndarray:
    """Pixels of the stripe where the plane crosses a board, and some of a reflection."""
    x = np.linspace(-0.01, 0.17, 300)
    y = np.linspace(-0.01, 0.11, 300)
    grid = np.stack([np.repeat(x, 300), np.tile(y, 300), np.zeros(90000)], axis=1)
    points = apply(T, grid)
    near = points[np.abs(distances(PLANE, points)) < 4e-5]
    up = T[:3, 2]
    across = PLANE[:3] - (PLANE[:3] @ up) * up  # on the board, towards the plane
    near = near - distances(PLANE, near)[:, None] * across / (across @ PLANE[:3])
    reflection = CAMERA.project(near[::8]) + np.array([40.0, 7.0])
    return np.concatenate([CAMERA.project(near) + rng.normal(0.0, noise, (len(near), 2)), reflection])


def test_camera_and_boards_come_back_from_corners():
    rng = np.random.default_rng(0)
    fit = fit_camera(BOARD, [seen(T, rng) for T in POSES], (800, 600))
    assert fit.used.all() and fit.rms_px.max() < 0.12
    assert fit.camera.focal_px == pytest.approx(1100.0, rel=2e-3) and fit.camera.aspect == pytest.approx(1.01, rel=1e-3)
    for T, found in zip(POSES, fit.Ts_camera_board, strict=True):
        assert pose_difference(T, found)[0] < 2e-3 and pose_difference(T, found)[1] < np.deg2rad(0.3)
    known = place_boards(BOARD, [seen(T, rng) for T in POSES], CAMERA)
    assert max(pose_difference(T, found)[0] for T, found in zip(POSES, known.Ts_camera_board, strict=True)) < 4e-4


def test_a_photograph_whose_corners_were_misread_is_left_out():
    rng = np.random.default_rng(1)
    corners = [seen(T, rng) for T in POSES]
    corners[3] = corners[3] + rng.normal(0.0, 6.0, (54, 2))
    fit = fit_camera(BOARD, corners, (800, 600))
    assert list(np.flatnonzero(~fit.used)) == [3] and len(fit.Ts_camera_board) == 5


def test_boards_that_all_face_the_camera_do_not_determine_it():
    rng = np.random.default_rng(2)
    flat = [seen(board_pose((0.0, 0.0, 0.2 * k), (0.01 * k, 0.0, 0.6)), rng, 0.3) for k in range(4)]
    with pytest.raises(BadInput, match="tilt the board"):
        fit_camera(BOARD, flat, (800, 600))
    with pytest.raises(BadInput, match="at least 3"):
        fit_camera(BOARD, flat[:2], (800, 600))


def test_the_laser_plane_comes_back_from_stripes_on_boards_without_their_reflections():
    rng = np.random.default_rng(3)
    stripes = [on_board(stripe_on(T, rng), CAMERA, T, BOARD) for T in POSES]
    assert all(points is not None and np.abs(distances(PLANE, points)).max() < 5e-4 for points in stripes)
    plane = laser_plane([points for points in stripes if points is not None])
    assert np.degrees(np.arccos(abs(plane.plane[:3] @ PLANE[:3]))) < 0.05
    assert abs(abs(plane.plane[3]) - abs(PLANE[3])) < 2e-4 and plane.rms < 1e-4
    assert on_board(stripe_on(POSES[0], rng)[:10], CAMERA, POSES[0], BOARD) is None


def test_stripes_that_lie_on_one_line_do_not_determine_the_plane():
    rng = np.random.default_rng(4)
    line = np.linspace(0, 0.15, 200)[:, None] * (0.0, 1.0, 0.0) + (0.0, 0.0, 0.5)
    stripes = [line + rng.normal(0.0, 1e-4, (200, 3)) for _ in range(4)]
    with pytest.raises(BadInput, match="one line"):
        laser_plane(stripes)
    with pytest.raises(BadInput, match="2 poses"):
        laser_plane(stripes[:1])


def test_the_range_frame_lies_on_the_board_and_does_not_depend_on_where_its_corners_begin():
    T = POSES[2]
    half_turn = transform(np.diag([-1.0, -1.0, 1.0]), 2 * BOARD.corners.mean(axis=0))
    for pose in (T, T @ half_turn):
        T_range_camera = range_frame(pose, BOARD)
        on_range = apply(T_range_camera, apply(pose, BOARD.corners))
        assert np.abs(on_range[:, 2]).max() < 1e-9 and np.allclose(on_range.mean(axis=0), 0.0, atol=1e-9)
        assert T_range_camera[2, 3] > 0 and T_range_camera[0, 0] > 0.8
    assert np.allclose(range_frame(T, BOARD), range_frame(T @ half_turn, BOARD))


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.05)])
def test_the_rigs_step_comes_back_from_two_photographs_of_a_resting_board(turn):
    T_range_camera = range_frame(POSES[0], BOARD)
    step = transform(Rotation.from_rotvec(turn).as_matrix(), (0.004, 0.001, 0.0))
    T_range_rig = np.linalg.matrix_power(step, 8)
    after = inverse(T_range_rig @ T_range_camera) @ T_range_camera @ POSES[0]
    assert np.allclose(one_step(POSES[0], after, BOARD, T_range_camera, 8, None), step, atol=1e-9)
    if turn[2] == 0.0:
        longer = one_step(POSES[0], after, BOARD, T_range_camera, 8, 0.005)
        assert np.linalg.norm(longer[:3, 3]) == pytest.approx(0.005) and longer[0, 3] / longer[1, 3] == pytest.approx(4.0)
        with pytest.raises(BadInput, match="moved"):
            one_step(POSES[0], POSES[0], BOARD, T_range_camera, 8, None)


@pytest.mark.parametrize("change", [{"columns": 1}, {"rows": 500}, {"square": 0.0}, {"pattern": "stars"}])
def test_a_board_that_cannot_be_is_refused(change):
    with pytest.raises(BadInput):
        replace(BOARD, **change)
