import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.light_paths import passing_heights
from handey_studio.sensing.solid import solid_columns, without_parts
from handey_studio.world import Part, PlacedPart

CELL, N = 0.002, 100
LIGHT = np.array([-0.4, 0.1, 0.6])  # far to the side, so that shadows are long


def shadowed(height, low, high):
    """Elevations of a block on a table, with the hole that its shadow from LIGHT leaves, and where the truth is solid."""
    j, i = np.mgrid[:N, :N]
    x, y = (i + 0.5) * CELL, (j + 0.5) * CELL
    top = np.where((x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1]), height, 0.0)
    share = np.linspace(0.0, 1.0, 300)[:, None, None]
    px, py, pz = x + share * (LIGHT[0] - x), y + share * (LIGHT[1] - y), share * LIGHT[2]
    dark = ((px > low[0]) & (px < high[0]) & (py > low[1]) & (py < high[1]) & (pz < height) & (pz > 0)).any(axis=0)
    elevation = np.where(dark & (top == 0.0), np.nan, top)
    return elevation, top


def depth_map(elevation):
    j, i = np.nonzero(np.isfinite(elevation))
    readings = np.c_[(i + 0.5) * CELL, (j + 0.5) * CELL, elevation[j, i]]
    passed = passing_heights(elevation, CELL, readings, np.broadcast_to(LIGHT, readings.shape))
    return DepthMap(elevation, CELL, np.eye(4), passed, noise=0.0003, outline_error=0.001)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.02, 0.09), st.floats(0.02, 0.06), st.floats(0.12, 0.15))
def test_a_shadow_is_solid_up_to_its_slope_and_no_higher(height, low, x_high):
    elevation, top = shadowed(height, (x_high - 0.03, low), (x_high, low + 0.05))
    hole = np.isnan(elevation)
    columns = solid_columns(depth_map(elevation)).top
    assert (columns >= top - 1e-9).all(), "what is solid in truth is solid in the map"
    assert np.allclose(columns[~hole], elevation[~hole])
    assert columns[hole].max(initial=0.0) <= height + 1e-9
    if hole.sum() > 30:
        assert columns[hole].min() < 0.6 * height, "the far end of a shadow is low"


def test_a_hole_without_light_beyond_is_solid_up_to_its_rim():
    elevation = np.zeros((N, N))
    elevation[40:60, 90:] = np.nan
    elevation[40:60, 86:90] = 0.03
    columns = solid_columns(depth_map(elevation)).top
    assert np.allclose(columns[45:55, 95], 0.03)


def test_nothing_read_is_solid_without_bound():
    columns = solid_columns(depth_map(np.full((N, N), np.nan))).top
    assert np.isinf(columns).all()


def test_a_part_takes_its_own_readings_and_no_others():
    part = Part("brick", box((0.05, 0.04, 0.03)))
    T = from_xyz_rpy((0.08, 0.10, 0.015), (0, 0, 0.4))
    j, i = np.mgrid[:N, :N]
    points = np.stack([(i + 0.5) * CELL, (j + 0.5) * CELL], axis=-1)
    local = (points - T[:2, 3]) @ T[:2, :2]
    on = (np.abs(local) < (0.025, 0.02)).all(axis=-1)
    elevation = np.where(on, 0.03, 0.0)
    neighbour = (np.abs(points - (0.15, 0.15)) < 0.02).all(axis=-1)
    elevation[neighbour] = 0.03
    dm = depth_map(elevation)
    left = without_parts(dm, solid_columns(dm), (PlacedPart("brick#1", part, T),)).top
    assert left[on].max() < 0.001
    assert np.allclose(left[neighbour], 0.03)


def test_what_a_tilted_part_stands_on_stays_solid_up_to_its_underside():
    part = Part("brick", box((0.05, 0.04, 0.03)))
    T = from_xyz_rpy((0.1, 0.1, 0.05), (0.0, 0.3, 0.0))
    elevation = np.full((N, N), 0.0)
    dm = depth_map(elevation)
    probe = PlacedPart("brick#1", part, T)
    elevation[42:58, 40:60] = 0.065
    columns = without_parts(depth_map(np.where(np.isfinite(elevation), elevation, 0)), solid_columns(depth_map(elevation)), (probe,)).top
    lowest = probe.corners_world[:, 2].min()
    centre = columns[50, 50]
    assert lowest - 1e-6 <= centre <= 0.05, (lowest, centre)
    assert dm.view().depth.shape == (N, N)


@pytest.mark.parametrize("beside", [0.0, 0.05])
def test_under_the_rim_of_a_part_that_leans_nothing_is_higher_than_what_was_read_beside_it(beside):
    part, T = Part("brick", box((0.05, 0.04, 0.03))), from_xyz_rpy((0.1, 0.1, 0.08), (0.0, 0.3, 0.0))
    j, i = np.mgrid[:N, :N]
    x, y = (i + 0.5) * CELL - 0.1, (j + 0.5) * CELL - 0.1
    over = (np.abs(x) < 0.018) & (np.abs(y) < 0.02)
    probe = PlacedPart("brick#1", part, T)
    elevation = np.where(over, 0.08 + (0.015 - np.sin(0.3) * x) / np.cos(0.3), 0.0)
    elevation[(np.abs(y) >= 0.02) & (np.abs(y) < 0.05)] = beside
    dm = depth_map(elevation)
    columns = without_parts(dm, solid_columns(dm), (probe,)).top
    rim = over & (np.abs(x) < 0.01) & (np.abs(y) > 0.019)
    assert np.allclose(columns[rim], beside, atol=1e-6)
    assert columns[over & (np.abs(x) < 0.01) & (np.abs(y) < 0.01)].min() > 0.055, "but what is under its middle may be as high as the part"


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.0, 0.04]))
def test_a_lone_reading_on_level_ground_is_noise_and_two_are_a_thing(seed, ground):
    rng = np.random.default_rng(seed)
    elevation = np.full((N, N), 0.0)
    elevation[20:80, 20:80] = ground
    elevation += rng.normal(0.0, 1e-4, elevation.shape)
    spot = tuple(rng.integers(24, 76, 2))
    spiked = elevation.copy()
    spiked[spot] = ground + rng.uniform(0.0015, 0.002)
    assert solid_columns(depth_map(spiked)).top[spot] < ground + 0.0006
    away = [(a, b) for a in (-2, -1, 0, 1, 2) for b in (-2, -1, 0, 1, 2) if (a, b) != (0, 0)]
    da, db = away[rng.integers(len(away))]
    other = spot[0] + da, spot[1] + db
    for second in (spiked[spot], np.nan):
        pair = spiked.copy()
        pair[other] = second
        assert solid_columns(depth_map(pair)).top[spot] == pair[spot], "two that agree, or one beside a hole, are taken for solid"
    spiked[spot] = ground + 0.01
    assert solid_columns(depth_map(spiked)).top[spot] == spiked[spot], "a needle that stands upright is no noise"
