"""How far outlines lie off: clean ones, ragged ones, and those that a sensor eats away."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from handey_studio.sensing.depth_view import Orthographic, Pinhole
from handey_studio.sensing.outlines import _contours, measured_outline_error
from tests.sensing.scenes import cast, looking_at, pile

KINECT = Pinhole(525.0, 525.0, 319.5, 239.5)
ABOVE = Orthographic(0.001, 255.5, 255.5)


def scene(seed, above=False, count=12):
    rng = np.random.default_rng(seed)
    boxes = pile(rng, count, 0.22, (0.03, 0.09))
    if above:
        return cast(boxes, looking_at((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)), ABOVE, (512, 512))
    return cast(boxes, looking_at((rng.uniform(-0.4, 0.4), -0.5, 0.6), (0.0, 0.0, 0.0)), KINECT, (480, 640))


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000), st.booleans(), st.sampled_from([0.0, 0.0005, 0.0015]), st.sampled_from([0.0, 0.03]))
def test_a_clean_outline_is_a_pixel_off(seed, above, noise, dropped):
    rng = np.random.default_rng(seed)
    depth = scene(seed, above)
    pixel = 0.001 if above else np.nanmedian(depth) / 525.0
    depth = depth + rng.normal(0.0, noise, depth.shape)
    depth[rng.random(depth.shape) < dropped] = np.nan
    assert 0.95 * pixel <= measured_outline_error(depth, ABOVE if above else KINECT, max(noise, 0.00015)) < 1.7 * pixel


@pytest.mark.parametrize("seed", range(3))
def test_a_ragged_outline_lies_off_by_more_than_it_wanders(seed):
    rng = np.random.default_rng(seed)
    depth = scene(seed, count=8)
    moved = []
    for _ in range(2):
        wave = ndimage.gaussian_filter(rng.normal(size=depth.shape), 5.0)
        moved.append(np.rint(0.9 * wave / wave.std()))
    v, u = np.indices(depth.shape)
    ragged = depth[np.clip(v + moved[0], 0, 479).astype(int), np.clip(u + moved[1], 0, 639).astype(int)]
    ragged = ragged + rng.normal(0.0, 0.001, depth.shape)
    pixel = np.nanmedian(depth) / 525.0
    assert 1.45 * pixel < measured_outline_error(ragged, KINECT, 0.001) < 5.0 * pixel


@pytest.mark.parametrize("lost", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("above", [False, True])
def test_readings_lost_by_chance_at_rims_are_no_wandering_outline(lost, above):
    depth, rng = scene(3, above), np.random.default_rng(3)
    beside = np.asarray(ndimage.maximum_filter(depth, 3)) - depth > 0.01
    depth[beside & (rng.random(depth.shape) < lost)] = np.nan
    pixel = 0.001 if above else np.nanmedian(depth) / 525.0
    error = measured_outline_error(depth + rng.normal(0.0, 0.0005, depth.shape), ABOVE if above else KINECT, 0.0005)
    assert pixel <= error < 1.4 * pixel


def test_readings_lost_on_all_sides_count_by_half_their_band():
    depth = scene(1, above=True)
    steps = np.asarray(ndimage.maximum_filter(depth, 3)) - depth > 0.01
    depth[np.asarray(ndimage.binary_dilation(steps, iterations=3), bool)] = np.nan
    assert 0.0025 < measured_outline_error(depth, ABOVE, 0.0002) < 0.006


def test_a_shadow_on_one_side_is_no_lost_outline():
    depth = scene(2, above=True)
    nearer_on_the_left = np.zeros(depth.shape, bool)
    for shift in range(1, 13):
        nearer_on_the_left[:, shift:] |= depth[:, :-shift] < depth[:, shift:] - 0.01
    depth[nearer_on_the_left] = np.nan
    assert measured_outline_error(depth, ABOVE, 0.0002) < 0.0017


@pytest.mark.parametrize("depth", [np.full((1, 1), 0.7), np.full((480, 640), np.nan), np.full((480, 640), 0.7), np.full((10, 640), 0.7)])
def test_no_jumps_are_told_as_two_pixels(depth):
    assert measured_outline_error(depth, KINECT, 0.001) == pytest.approx(2.0 * (0.7 if np.isfinite(depth).any() else 1.0) / 525.0)


def test_a_straight_slanting_contour_does_not_wander_and_one_with_a_corner_does():
    depth = np.full((23, 80), 1.0)
    for line in range(23):
        depth[line, : 20 + line] = 0.9
    tops = np.zeros(1, dtype=np.int64)
    assert _contours(depth, tops, 1, 0.01, 0.001)[0] == pytest.approx([0.0, 1.0])
    depth[11:, :] = 1.0
    for line in range(11, 23):
        depth[line, : 42 - line] = 0.9
    assert _contours(depth, tops, 1, 0.01, 0.001)[0, 0] > 2.0
    assert not len(_contours(depth, tops, -1, 0.01, 0.001))


def test_it_is_quick():
    depth = scene(7) + np.random.default_rng(7).normal(0.0, 0.001, (480, 640))
    measured_outline_error(depth, KINECT, 0.001)
    begun = time.process_time()
    for _ in range(5):
        measured_outline_error(depth, KINECT, 0.001)
    assert (time.process_time() - begun) / 5 < 0.06
