"""The stripe camera's lens and its triangulation, against OpenCV's own projection and against truth."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.sensing.stripes.laser_planes import distances, fit_plane, moved_planes, plane_through, turning_planes
from handey_studio.sensing.stripes.stripe_camera import camera_looking_at, points_on_planes

PLAIN = camera_looking_at((-0.3, 0.1, 0.6), (0.0, 0.1, 0.0))
LENSES = (
    (-0.25, 0.12, 0.001, -0.0008),
    (0.1, -0.2, -0.0005, 0.001, 0.05),
    (0.2, -0.1, 0.0004, 0.0, 0.01, 0.15, -0.08, 0.0),
    (-0.2, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.001, -0.002, 0.0005, 0.001),
)


def with_lens(lens):
    return replace(PLAIN, focal_px=900.0, aspect=1.02, centre_px=(400.0, 371.0), distortion=lens)


@pytest.mark.parametrize("lens", LENSES)
def test_the_lens_is_opencvs_and_its_inverse_comes_back(lens):
    camera = with_lens(lens)
    points = np.random.default_rng(0).uniform((-0.3, -0.3, 0.7), (0.3, 0.3, 1.0), (200, 3))
    wanted = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, np.array(lens))[0].reshape(-1, 2)
    assert np.allclose(camera.project(points), wanted, atol=1e-9)
    assert np.allclose(camera.rays(wanted), points / points[:, 2:], atol=1e-6)


def test_pixels_that_the_lens_cannot_have_seen_have_no_ray():
    camera = replace(PLAIN, focal_px=200.0, distortion=(-0.4, 0.0, 0.0, 0.0))
    far = camera.rays(np.array([[410.0, 360.0], [5.0, 5.0]]))
    assert np.isfinite(far[0]).all() and np.isnan(far[1]).all()


@settings(max_examples=50, deadline=None)
@given(st.floats(-0.3, 0.3), st.floats(-0.1, 0.1), st.floats(0.0, 0.2), st.sampled_from(LENSES))
def test_a_lit_point_is_triangulated_back(turn, y, z, lens):
    camera = with_lens(lens)
    plane = turning_planes((0.05, 0.0, 0.8), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), [turn])[0]
    point = np.array([0.05 + (0.8 - z) * np.tan(turn), y, z])
    assert abs(distances(plane, point[None])[0]) < 1e-12
    uv = camera.project(apply(inverse(camera.T_range_camera), point)[None])
    assert np.allclose(points_on_planes(camera, uv, plane), point, atol=2e-6)


def test_rays_along_the_plane_or_away_from_it_give_no_point():
    eye = PLAIN.T_range_camera[:3, 3]
    middle = np.array([[(PLAIN.width - 1) / 2, (PLAIN.height - 1) / 2]])
    ahead = PLAIN.T_range_camera[:3, 2]
    along = plane_through(np.cross(ahead, (0.0, 1.0, 0.0)), eye + np.array([0.0, 0.0, 0.1]))
    behind = plane_through(ahead, eye - 0.1 * ahead)
    before = plane_through(ahead, eye + 0.1 * ahead)
    for plane, seen in ((along, False), (behind, False), (before, True)):
        assert np.isfinite(points_on_planes(PLAIN, middle, plane)).all() == seen


def test_a_lens_of_another_length_is_refused():
    with pytest.raises(BadInput, match="distortion"):
        replace(PLAIN, distortion=(0.1, 0.2, 0.3))


def test_the_best_plane_forgets_outliers_and_tells_how_far_it_is_known():
    rng = np.random.default_rng(4)
    true = plane_through((0.2, -0.9, 0.4), (0.1, 0.0, 0.5))
    side = np.cross(true[:3], (1.0, 0.0, 0.0))
    side /= np.linalg.norm(side)
    along = np.cross(side, true[:3])
    points = true[:3] * true[3] + rng.uniform(-0.2, 0.2, (400, 1)) * along + rng.uniform(-0.05, 0.05, (400, 1)) * side
    points += rng.normal(0.0, 1e-4, (400, 1)) * true[:3]
    points[:40] += 0.02 * true[:3]
    fit = fit_plane(points)
    assert not fit.kept[:40].any() and fit.kept[40:].mean() > 0.97
    assert abs(abs(fit.plane[:3] @ true[:3]) - 1.0) < 1e-7 and fit.rms == pytest.approx(1e-4, rel=0.15)
    assert fit.extents == pytest.approx([0.2 / np.sqrt(3), 0.05 / np.sqrt(3)], rel=0.1)


def test_planes_move_with_their_points():
    rng = np.random.default_rng(5)
    T = inverse(PLAIN.T_range_camera)
    plane = plane_through(rng.normal(size=3), rng.normal(size=3))
    points = rng.normal(size=(20, 3))
    assert np.allclose(distances(moved_planes(T, plane), apply(T, points)), distances(plane, points))
