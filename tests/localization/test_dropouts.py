"""Edges over dropouts: a band that the sensor did not read breaks no edge; gaps that were seen do."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole
from tests.localization.boxes import box_edges, depth_of, edges_of, errors
from tests.localization.rendering import looking_at

NOISE = 0.0004
PINHOLE = Pinhole(600.0, 600.0, 159.5, 119.5)
ABOVE = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1], [0, 0, 0, 1]])
FROM_ABOVE = Orthographic(0.001, 99.5, 99.5)


def seen(depth, projection, T_world_sensor, unread=None):
    depth = np.where(unread, np.nan, depth) if unread is not None else depth
    return edges_of(DepthView(depth, projection, T_world_sensor, NOISE, 0.001), 0.015)


def long_ones(edges, kinds, least=0.06):
    return [edge for edge in edges if edge.kind in kinds and edge.length > least]


def on_line(edges, edge):
    """The jumps on the line of one of them, longest first."""
    alike = [other for other in edges if other.kind == "jump" and abs(other.direction @ edge.direction) > 0.995]
    return [
        other for other in alike if np.linalg.norm(np.cross(other.ends_sensor.mean(axis=0) - edge.ends_sensor[0], edge.direction)) < 0.003
    ]


@settings(max_examples=15, deadline=None)
@given(yaw=st.floats(-3.0, 3.0), across=st.floats(0.0, 3.1), place=st.integers(-12, 12), width=st.integers(4, 14), seed=st.integers(0, 99))
@example(yaw=-1.125, across=2.5625, place=0, width=4, seed=31)  # slanting, so that the surface is read in most of the gap
@example(yaw=0.8218, across=1.9486, place=-11, width=10, seed=78)  # the gap is longer than the shorter piece
@example(yaw=-2.8338, across=1.4782, place=9, width=4, seed=23)  # a short piece between two long ones
def test_a_band_without_readings_breaks_no_long_edge(yaw, across, place, width, seed):
    """A box below a camera, with and without the band: each long edge that the band crosses is one still, and true."""
    size, T = np.array([0.14, 0.09, 0.05]), from_xyz_rpy((0, 0, 0.025), (0, 0, yaw))
    T_world_sensor = looking_at(np.array([0.02, 0.01, 0.55]), np.array([0, 0, 0.03]))
    depth = depth_of([(size, T)], PINHOLE, T_world_sensor, (240, 320))
    depth = depth + np.random.default_rng(seed).normal(0, NOISE, depth.shape)
    v, u = np.mgrid[:240, :320]
    band = np.abs((u - 160) * np.cos(across) + (v - 120) * np.sin(across) - place) < width / 2
    whole, broken = (seen(depth, PINHOLE, T_world_sensor, unread) for unread in (None, band))
    true = box_edges([(size, T)])
    for edge in long_ones(whole, ("jump",), 0.08):
        ends_uv = PINHOLE.project(edge.ends_sensor)
        sides = (ends_uv - (160, 120)) @ (np.cos(across), np.sin(across)) - place
        square = abs(sides[1] - sides[0]) / np.linalg.norm(ends_uv[1] - ends_uv[0])
        if min(abs(sides)) < width / 2 + 25 or sides[0] * sides[1] > 0 or square < 0.7:
            continue  # it does not cross, leaves no piece to speak of, or takes a long part away
        before, pieces = on_line(whole, edge), on_line(broken, edge)
        assert len(pieces) <= len(before) and pieces[0].length > 0.8 * edge.length
        assert errors(pieces[0], true)[0] < 0.001


def test_a_crease_is_one_over_a_band_too():
    v, u = np.mgrid[:120, :160].astype(float)
    across = u - 80 + 0.02 * (v - 60)
    depth = 0.8 + np.tan(np.deg2rad(35.0)) * 0.001 * np.abs(across - 0.4) + np.random.default_rng(5).normal(0, NOISE, u.shape)
    whole, bridged = (seen(depth, FROM_ABOVE, np.eye(4), unread)[0] for unread in (None, np.abs(v - 55) < 5))
    assert whole.kind == bridged.kind == "convex" and bridged.length == pytest.approx(whole.length, abs=0.004)
    assert np.abs(bridged.direction @ whole.direction) > np.cos(np.deg2rad(0.2)) and bridged.pixels < whole.pixels


def in_line(gap, bridge=None, lift=0.0):
    """Two boxes end to end along x, `gap` [m] apart, one `lift` higher, and a bar `bridge` [m] wide above the gap."""
    size = np.array([0.07, 0.05, 0.04])
    boxes = [
        (size + np.array([0, 0, k * lift]), from_xyz_rpy((side * (0.035 + gap / 2), 0, 0.02 + k * lift / 2), (0, 0, 0)))
        for k, side in enumerate((-1, 1))
    ]
    if bridge:
        boxes.append((np.array([bridge, 0.12, 0.02]), from_xyz_rpy((0, 0, 0.07), (0, 0, 0))))
    depth = depth_of(boxes, FROM_ABOVE, ABOVE, (200, 200))
    return depth + np.random.default_rng(0).normal(0, NOISE, depth.shape)


def along_x(edges):
    return sorted(
        round(edge.length, 2)
        for edge in edges
        if abs(edge.direction[0]) > 0.99 and edge.ends_world[:, 2].mean() > 0.03 and edge.length < 0.2
    )


def test_a_gap_that_was_seen_stays_one():
    assert along_x(seen(in_line(0.012), FROM_ABOVE, ABOVE)) == [0.07] * 4


def test_what_crosses_above_parts_an_edge():
    """One long box below a bar: its long edges stay in two pieces each, as nobody saw that they go on."""
    lengths = along_x(seen(in_line(0.0, bridge=0.014), FROM_ABOVE, ABOVE))
    assert [length for length in lengths if length > 0.04] == pytest.approx([0.06] * 4, abs=0.011)


def test_the_same_gap_unread_is_bridged_only_on_one_surface():
    column = np.abs(np.arange(200) - 99.5) < 9
    unread = np.tile(column, (200, 1))
    assert along_x(seen(in_line(0.0), FROM_ABOVE, ABOVE, unread)) == pytest.approx([0.14] * 2, abs=0.011)
    assert max(along_x(seen(in_line(0.0, lift=0.006), FROM_ABOVE, ABOVE, unread))) < 0.08, "one lies 6 mm higher"
