"""Shares of work make up the whole, and the answer does not depend on how many cores there are."""

import numpy as np
import pytest
from numba import config

from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.localization.edges import edge_pixels
from handey_studio.localization.shares import SHARES, shared
from handey_studio.localization.surface import surface_of
from handey_studio.sensing.depth_view import DepthView, Pinhole
from tests.localization.boxes import depth_of


@pytest.mark.parametrize("cores", [1, 2, 5])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 7, 100])
def test_every_number_is_worked_on_once(monkeypatch, cores, count):
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", cores)
    times = np.zeros(count)

    def work(first, last):
        times[first:last] += 1

    shared(work, count, least=2)
    assert (times == 1).all()


def test_little_work_stays_in_one_piece():
    calls = []
    shared(lambda first, last: calls.append((first, last)), 2 * SHARES - 1, least=SHARES)
    assert calls == [(0, 2 * SHARES - 1)]


def test_what_goes_wrong_in_a_share_is_told(monkeypatch):
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", 2)
    with pytest.raises(ZeroDivisionError):
        shared(lambda first, last: 1 // 0, 10)


def test_normals_and_edges_are_the_same_with_any_number_of_cores(monkeypatch):
    T_world_sensor = from_xyz_rpy((0.05, 0, 0.6), (np.pi, 0, 0))
    pinhole = Pinhole(150.0, 150.0, 64.0, 48.0)
    depth = depth_of([(np.array([0.1, 0.07, 0.05]), from_xyz_rpy((0, 0, 0.05), (0.3, 0.2, 0.6)))], pinhole, T_world_sensor, (97, 128))
    depth += np.random.default_rng(0).normal(0.0, 5e-4, depth.shape)
    view = DepthView(depth, pinhole, T_world_sensor, 5e-4, 1e-3)
    seen = []
    for cores in (1, 2, 3):
        monkeypatch.setattr(config, "NUMBA_NUM_THREADS", cores)
        surface = surface_of(view)
        pixels = edge_pixels(view, surface)
        seen.append((surface.slope, surface.normals, pixels.kind, pixels.outward))
    for other in seen[1:]:
        for one, same in zip(seen[0], other, strict=True):
            np.testing.assert_array_equal(one, same)
    assert (seen[0][2] > 0).sum() > 50
