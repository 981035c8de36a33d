"""The noise of a depth image: put in, and measured again."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from handey_studio.sensing.depth_view import Orthographic, Pinhole
from handey_studio.sensing.noise import LEAST_M, measured_noise, noise_of
from handey_studio.sensing.windows import fit_windows
from tests.sensing.scenes import cast, looking_at, pile

KINECT = Pinhole(525.0, 525.0, 319.5, 239.5)
ABOVE = Orthographic(0.001, 255.5, 255.5)


def scene(rng, count=12, projection: Pinhole | Orthographic = KINECT):
    eye = (rng.uniform(-0.4, 0.4), rng.uniform(-0.5, -0.2), 0.8)
    shape = (480, 640) if projection is KINECT else (512, 512)
    T = looking_at(eye, (0.0, 0.0, 0.0)) if projection is KINECT else looking_at((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    return cast(pile(rng, count), T, projection, shape)


@settings(max_examples=8, deadline=None)
@given(st.sampled_from([0.0003, 0.0005, 0.001, 0.002]), st.integers(0, 30), st.integers(0, 10_000), st.booleans())
def test_white_noise_is_measured_under_steps_steep_faces_and_dropouts(sigma, count, seed, above):
    rng = np.random.default_rng(seed)
    projection = ABOVE if above else KINECT
    depth = scene(rng, count, projection)
    depth = depth + rng.normal(0.0, sigma, depth.shape)
    depth[rng.random(depth.shape) < 0.1] = np.nan
    assert 0.85 * sigma < measured_noise(depth, projection) < 1.3 * sigma


@pytest.mark.parametrize(("quantum", "low", "high"), [(0.0001, LEAST_M, 0.0003), (0.001, 0.00028, 0.00045)])
def test_depth_in_steps_is_as_noisy_as_its_steps(quantum, low, high):
    depth = np.round(scene(np.random.default_rng(1)) / quantum) * quantum
    assert low <= measured_noise(depth, KINECT, quantum) <= high
    assert low <= measured_noise(np.full((480, 640), 0.7), KINECT, quantum) <= high


def test_exact_depth_keeps_a_floor():
    assert measured_noise(scene(np.random.default_rng(2)), KINECT) == pytest.approx(LEAST_M, rel=0.5)
    assert measured_noise(np.full((480, 640), 0.7), KINECT) == LEAST_M


@pytest.mark.parametrize("smoothing", [1.5, 3.0])
def test_a_sensor_that_smooths_is_not_believed(smoothing):
    rng = np.random.default_rng(3)
    depth = scene(rng)
    shared = ndimage.gaussian_filter(rng.normal(0.0, 1.0, depth.shape), smoothing)
    depth = depth + 0.0015 * shared / shared.std()
    assert 0.0009 < measured_noise(depth, KINECT) < 0.0022


def test_a_heap_of_small_parts_without_a_table_is_no_noise():
    rng = np.random.default_rng(8)
    view = Pinhole(262.0, 262.0, 159.5, 119.5)
    depth = cast(pile(rng, 150, 0.15, (0.01, 0.02)), looking_at((0.0, -0.1, 0.4), (0.0, 0.0, 0.0)), view, (240, 320), table=None)
    assert 0.0004 < measured_noise(depth + rng.normal(0.0, 0.0005, depth.shape), view) < 0.0011


def test_flying_pixels_are_no_noise():
    rng = np.random.default_rng(4)
    depth = scene(rng)
    depth = depth + rng.normal(0.0, 0.001, depth.shape)
    stray = rng.random(depth.shape) < 0.02
    depth[stray] += rng.uniform(-0.2, 0.2, int(stray.sum()))
    assert 0.0009 < measured_noise(depth, KINECT) < 0.0013


@pytest.mark.parametrize(("power", "growth"), [(2.0, 2.0), (0.0, 0.0)])
def test_growth_with_depth_only_where_the_readings_show_it(power, growth):
    rng = np.random.default_rng(5)
    depth = cast(pile(rng, 8), looking_at((0.0, -0.9, 0.5), (0.0, 0.0, 0.0)), KINECT, (480, 640))
    middle = np.nanmedian(depth)
    found = noise_of(depth + 0.001 * (depth / middle) ** power * rng.normal(size=depth.shape), KINECT)
    assert found.growth == growth
    assert 0.0009 < found.sigma < 0.0013


@pytest.mark.parametrize(
    "depth", [np.full((1, 1), 0.7), np.full((480, 640), np.nan), np.full((5, 900), 0.7), np.zeros((40, 40)), np.full((40, 40), np.inf)]
)
def test_too_little_to_measure_gives_a_usual_sensor(depth):
    found = noise_of(depth, KINECT)
    assert found.windows == 0 and 0.0005 <= found.sigma <= 0.005


def test_the_fast_residuals_are_those_of_least_squares():
    rng = np.random.default_rng(6)
    depth = cast([], looking_at((0.1, -0.5, 0.7), (0.0, 0.0, 0.0)), KINECT, (480, 640))[200:217, 300:317]
    depth = depth + rng.normal(0.0, 0.0005, depth.shape)
    depth[3, 4] = np.nan
    v, u = np.mgrid[:17, :17]
    known = np.isfinite(depth)
    d = depth[known]
    A = np.c_[np.ones(known.sum()), u[known], v[known]]
    plane, *_ = np.linalg.lstsq(A, 1.0 / d, rcond=None)
    plain = np.sqrt(((d - 1.0 / (A @ plane)) ** 2).sum() / (len(d) - 3))
    start = np.zeros(1, dtype=np.int64)
    found = fit_windows(np.ascontiguousarray(depth), start, start, 17, True, 0.5)[0]
    assert found[0] == pytest.approx(d.mean(), rel=1e-3)
    assert found[1] == pytest.approx(plain, rel=0.03)  # the fast one leaves out what lies beyond three deviations


def test_it_is_quick():
    depth = scene(np.random.default_rng(7)) + np.random.default_rng(7).normal(0.0, 0.001, (480, 640))
    measured_noise(depth, KINECT)
    begun = time.process_time()
    for _ in range(5):
        measured_noise(depth, KINECT)
    assert (time.process_time() - begun) / 5 < 0.03
