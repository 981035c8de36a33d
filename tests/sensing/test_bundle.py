"""Corners and stripes fitted together come nearer to the hidden camera and laser plane than the corners alone."""

import numpy as np

from handey_studio.sensing.stripes.board import fit_camera
from handey_studio.sensing.stripes.board_stripes import on_board
from handey_studio.sensing.stripes.bundle import bundle
from handey_studio.sensing.stripes.calibrate import laser_plane
from handey_studio.sensing.stripes.stripe_camera import points_on_planes
from tests.sensing.test_calibrate import BOARD, CAMERA, PLANE, POSES, seen, stripe_on


def test_the_bundle_is_nearer_to_the_truth_and_keeps_a_camera_that_is_known():
    off: dict[str, list[float]] = {"corners": [], "bundle": []}
    for seed in range(4):
        rng = np.random.default_rng(seed)
        corners = [seen(T, rng, 0.15) for T in POSES]
        fit = fit_camera(BOARD, corners, (800, 600))
        on = [on_board(stripe_on(T, rng), fit.camera, pose, BOARD) for T, pose in zip(POSES, fit.Ts_camera_board, strict=True)]
        stripes = [None if points is None else fit.camera.project(points) for points in on]
        plane = laser_plane([points for points in on if points is not None]).plane
        refined = bundle(BOARD, corners, stripes, fit, plane, keep=False)
        for how, camera, found in (("corners", fit.camera, plane), ("bundle", refined.fit.camera, refined.plane)):
            uv = np.concatenate([CAMERA.project(points) for points in on if points is not None])
            true = points_on_planes(CAMERA, uv, PLANE)
            off[how].append(float(np.linalg.norm(points_on_planes(camera, uv, found) - true, axis=1).mean()))
        kept = bundle(BOARD, corners, stripes, fit, plane, keep=True)
        assert kept.fit.camera.focal_px == fit.camera.focal_px and np.allclose(kept.fit.camera.distortion, fit.camera.distortion)
    assert np.mean(off["bundle"]) < np.mean(off["corners"]), off
