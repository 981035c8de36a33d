"""Stripes drawn at known places are found there to a fraction of a pixel; what is no single stripe is dropped with its reason."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import curve_fit

from handey_studio.base import BadInput
from handey_studio.sensing.stripes.stripe_peaks import PeakOptions, find_peaks, stripe_direction
from tests.sensing.stripe_images import noisy, none_saturated, stripe

ROWS, WIDTH = 120, 160


def found(light, direction="down", saturated=None):
    return find_peaks(light, none_saturated(light) if saturated is None else saturated, direction)


@settings(max_examples=40, deadline=None)
@given(
    start=st.floats(30, 130),
    slope=st.floats(-0.7, 0.7),
    sigma=st.floats(0.5, 6.0),
    light=st.floats(40, 220),
    room=st.floats(0, 25),
    seed=st.integers(0, 99),
)
def test_a_stripe_is_found_where_it_was_drawn(start, slope, sigma, light, room, seed):
    centres = np.clip(start + slope * (np.arange(ROWS) - ROWS / 2), 25, 135)
    image = noisy(stripe(centres, WIDTH, sigma, light) + room, np.random.default_rng(seed))
    peaks = found(image)
    assert len(peaks.uv) >= 0.95 * ROWS
    off = peaks.uv[:, 0] - centres[peaks.uv[:, 1].astype(int)]
    width = max(sigma, 1.0)  # a stripe thinner than a pixel is seen as wide as one
    assert np.sqrt(np.mean(off**2)) < 0.03 + 6.0 * width / light  # noise moves a broad faint stripe more
    assert abs(np.median(off)) < 0.02 + width / light


def test_a_stripe_across_is_the_same_stripe_turned():
    rng = np.random.default_rng(3)
    light = noisy(stripe(70.3 + 8 * np.sin(np.arange(ROWS) / 15), WIDTH, 1.2, 120.0), rng)
    down, across = found(light), found(np.ascontiguousarray(light.T), "across")
    assert np.array_equal(down.uv, across.uv[:, ::-1]) and down.dropped == across.dropped
    assert stripe_direction([(light, none_saturated(light))]) == "down"
    assert stripe_direction([(light.T, none_saturated(light.T))]) == "across"


def test_the_centre_of_gravity_agrees_with_a_fitted_gaussian():
    """The naive and slow way: a Gaussian and a level, by least squares, on each row's pixels."""
    centres = 60.0 + np.linspace(0, 1, 60)
    light = noisy(stripe(centres, WIDTH, 1.6, 150.0) + 10, np.random.default_rng(1))
    peaks = found(light)
    x = np.arange(WIDTH)
    for u, v in peaks.uv[::4]:
        start = (100.0, float(np.argmax(light[int(v)])), 1.5, 10.0)
        (_, centre, _, _), _ = curve_fit(lambda x, a, c, s, b: a * np.exp(-0.5 * ((x - c) / s) ** 2) + b, x, light[int(v)], start)
        assert u == pytest.approx(centre, abs=0.06)


def test_a_white_hot_core_does_not_move_the_peak():
    centres = 80.0 + np.linspace(-0.5, 0.5, ROWS)
    hot = stripe(centres, WIDTH, 2.5, 900.0)
    image = noisy(hot, np.random.default_rng(2))
    peaks = found(image, saturated=image >= 250)
    off = peaks.uv[:, 0] - centres[peaks.uv[:, 1].astype(int)]
    assert len(off) >= 0.95 * ROWS and np.sqrt(np.mean(off**2)) < 0.06
    excess = np.where(image >= 250, 0.0, image).astype(np.float32)  # in the laser's colour a white core is dark
    peaks = found(excess, saturated=image >= 250)
    off = peaks.uv[:, 0] - centres[peaks.uv[:, 1].astype(int)]
    assert len(off) >= 0.95 * ROWS and np.sqrt(np.mean(off**2)) < 0.25


def test_what_is_no_single_stripe_is_dropped_with_its_reason():
    centres = np.full(ROWS, 50.0)
    one = stripe(centres, WIDTH, 1.2, 120.0)
    cases = {
        "two peaks": one + stripe(centres + 40, WIDTH, 1.2, 110.0),
        "too wide": stripe(centres, WIDTH, 14.0, 120.0),
        "at the border": stripe(np.full(ROWS, 0.2), WIDTH, 1.2, 120.0),
        "no stripe": np.zeros((ROWS, WIDTH)),
    }
    for reason, light in cases.items():
        peaks = found(noisy(light + 5, np.random.default_rng(0)))
        assert peaks.dropped[reason] >= 0.9 * ROWS, (reason, peaks.dropped)
        assert len(peaks.uv) <= 0.02 * ROWS
    for light, reason in ((one[:, :], None), (np.where(np.arange(ROWS)[:, None] % 20 == 0, one, 0.0), "alone")):
        peaks = found(noisy(light, np.random.default_rng(0)))
        assert (len(peaks.uv) == ROWS) if reason is None else (peaks.dropped[reason] == 6 and not len(peaks.uv))
    assert len(peaks.uv) + sum(peaks.dropped.values()) == ROWS, "every row is accounted for"


def test_a_weak_reflection_beside_the_stripe_and_where_there_is_none_is_left_out():
    centres = np.full(ROWS, 50.0)
    lit = np.where(np.arange(ROWS)[:, None] < 80, stripe(centres, WIDTH, 1.5, 220.0), 0.0)
    faint = stripe(centres + 60, WIDTH, 1.5, 7.0)
    peaks = found(lit + faint + 0.0 * WIDTH)
    assert np.abs(peaks.uv[:, 0] - 50).max() < 0.1 and len(peaks.uv) == 80
    assert peaks.dropped["faint"] == ROWS - 80


def test_broad_light_is_no_stripe_and_does_not_move_one():
    x = np.arange(WIDTH)
    glow = 60.0 * np.exp(-0.5 * ((x - 100) / 45.0) ** 2)[None] + np.zeros((ROWS, 1))
    assert len(found(noisy(glow, np.random.default_rng(0))).uv) <= 2
    peaks = found(noisy(glow + stripe(np.full(ROWS, 70.25), WIDTH, 1.5, 100.0), np.random.default_rng(0)))
    assert len(peaks.uv) >= 0.95 * ROWS and abs(np.median(peaks.uv[:, 0]) - 70.25) < 0.1


@pytest.mark.parametrize("shape", [(1, 1), (1, 50), (50, 1), (3, 3)])
def test_photographs_of_a_few_pixels_have_an_answer(shape):
    light = np.full(shape, 200.0, dtype=np.float32)
    for direction in ("down", "across"):
        assert found(light, direction).uv.shape == (0, 2)


def test_only_two_directions_are_known():
    with pytest.raises(BadInput, match="down"):
        find_peaks(np.zeros((5, 5)), np.zeros((5, 5), dtype=bool), "sideways", PeakOptions())
