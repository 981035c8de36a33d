"""A stripe averaged along itself: grain goes, corners and steps stay; the light in which the stripe is finest is chosen."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from handey_studio.sensing.stripes.photographs import Photograph
from handey_studio.sensing.stripes.stripe_along import along, roughness
from handey_studio.sensing.stripes.stripe_light import laser_light
from handey_studio.sensing.stripes.stripe_look import how_it_looks
from handey_studio.sensing.stripes.stripe_peaks import PeakOptions, find_peaks
from tests.sensing.stripe_images import noisy, stripe

ROWS = np.arange(400)
RUNS = {
    "straight": 0.2 * ROWS,
    "step": 0.2 * ROWS + np.where(ROWS > 200, 6.0, 0.0),
    "corner": 0.2 * ROWS + np.where(ROWS > 200, 0.5 * (ROWS - 200), 0.0),
    "arc": np.sqrt(250.0**2 - (ROWS - 200.0) ** 2),
}


def off(run, grain, seed, reach=8) -> tuple[np.ndarray, np.ndarray]:
    """How far noisy places lie off a run before and after averaging; `grain` is how many rows share their error."""
    error = np.random.default_rng(seed).normal(0.0, 1.0, len(run))
    error = gaussian_filter1d(error, grain) if grain else error
    places = run + 0.1 * error / error.std()
    return places - run, along(places, roughness(places), reach) - run


@pytest.mark.parametrize("name", list(RUNS))
@pytest.mark.parametrize("grain", [0, 3])
def test_grain_is_averaged_away_and_corners_stay(name, grain):
    before, after = np.concatenate([np.stack(off(RUNS[name], grain, seed)) for seed in range(10)], axis=1)
    near = np.tile(np.abs(ROWS - 200.5) < 8, 10)
    rms = [float(np.sqrt(np.mean(error**2))) for error in (before, after, before[near], after[near])]
    assert rms[1] < ((1.05 if grain else 0.8) if name == "arc" else (0.9 if grain else 0.6)) * rms[0], "an arc is not made a polygon"
    assert rms[3] < 1.3 * rms[2], "beside a corner no place becomes much worse than the grain makes it"


def test_the_line_is_the_one_that_least_squares_gives():
    """The naive way: polyfit over the stretch, for a run so straight that the longest stretch is always taken."""
    places = 30.0 + 0.3 * ROWS[:60] + np.random.default_rng(0).uniform(-0.02, 0.02, 60)
    found = along(places, 1.0, 8)
    for row in range(60):
        x = np.arange(max(0, row - 8), min(60, row + 9))
        if len(x) == 17:
            assert found[row] == pytest.approx(np.polyval(np.polyfit(x, places[x], 1), row), abs=1e-9)


def test_gaps_stay_gaps_and_what_is_too_short_to_tell_stays_as_it_is():
    places = np.where(ROWS % 50 < 40, 0.1 * ROWS, np.nan)
    assert np.array_equal(np.isnan(along(places, 0.05, 8)), np.isnan(places))
    assert np.isnan(roughness(places[:20])) and np.array_equal(along(places[:20], roughness(places[:20]), 8), places[:20])


def test_an_overexposed_channel_is_left_for_one_that_still_shows_the_stripes_form():
    """Red at the scale's end over ten pixels and leaning to the glare on one side, green with a form of its own."""
    rng = np.random.default_rng(4)
    centres = 70.0 + 0.05 * np.arange(120)
    sway = 3.0 * gaussian_filter1d(rng.normal(0.0, 1.0, 120), 4)
    red = stripe(centres, 160, 4.0, 2500.0) + stripe(centres + 6.0 + sway, 160, 3.0, 300.0)
    lit = noisy(np.stack([0.02 * red, stripe(centres, 160, 1.8, 130.0), red], axis=2) + 60.0, rng)
    photograph = Photograph(lit, lit.max(axis=2) >= 240)
    dark = Photograph(noisy(np.full((120, 160, 3), 60.0), rng), np.zeros((120, 160), bool))
    light, direction = how_it_looks([(photograph, dark)], "auto")
    assert light.weights == (0.0, 1.0, 0.0) and light.name == "red" and direction == "down"
    kept, _ = how_it_looks([(photograph, dark)], "red")
    rms = []
    for one in (light, kept):
        peaks = find_peaks(laser_light(photograph, dark, one), photograph.saturated, "down", PeakOptions())
        rms.append(np.sqrt(np.mean((peaks.uv[:, 0] - centres[peaks.uv[:, 1].astype(int)]) ** 2)))
    assert rms[0] < 0.05 < rms[1] and peaks.saturated.all()
