"""Poses that are the same pose: near to one another, or differing by a symmetry of the part."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.world.part import Part

PLACE_SHARE = 0.25  # of a part's diameter: poses whose middles are nearer than this are at one place


def distinct(R: NDArray, t: NDArray, order: NDArray, part: Part, apart: float, most: int, most_a_place: int = 1000) -> NDArray:
    """Numbers of poses R (n, 3, 3), t (n, 3), in the given order, that differ from all earlier ones by more than `apart` [m]
    at some point of the part; at most `most`, and at most `most_a_place` at one place, so that one instance in full view does not
    crowd out those that are half hidden."""
    return _distinct(R, t, order, probe_points(part), apart, most, PLACE_SHARE * part.solid.diameter, most_a_place)


def displacement(T_a: NDArray, T_b: NDArray, part: Part) -> float:
    """Greatest displacement [m] of the part's probe points between two poses (4, 4), the least over its symmetries."""
    probes = probe_points(part)
    a = probes[0] @ T_a[:3, :3].T + T_a[:3, 3]
    b = probes @ T_b[:3, :3].T + T_b[:3, 3]
    return float(np.linalg.norm(b - a, axis=2).max(axis=1).min())


def probe_points(part: Part) -> NDArray:
    """Images (k, 4, 3) [m] of the centroid and three points around it under the part's symmetries, the identity first."""
    solid = part.solid
    points = solid.volume_and_centroid[1] + 0.5 * solid.diameter * np.vstack([np.zeros(3), np.eye(3)])
    return np.array([points @ T[:3, :3].T + T[:3, 3] for T in part.symmetries])


@njit(cache=True)
def _moved(R, t, points, out):
    """Points (4, 3) at a pose, into `out`."""
    for p in range(len(points)):
        for r in range(3):
            out[p, r] = R[r, 0] * points[p, 0] + R[r, 1] * points[p, 1] + R[r, 2] * points[p, 2] + t[r]


@njit(cache=True)
def _nearer(one, other, limit):
    """Whether all four points lie nearer than `limit` to their counterparts; told at the first that does not."""
    for p in range(len(one)):
        x, y, z = one[p, 0] - other[p, 0], one[p, 1] - other[p, 1], one[p, 2] - other[p, 2]
        if x * x + y * y + z * z >= limit * limit:
            return False
    return True


@njit(cache=True)
def _distinct(R, t, order, probes, apart, most, place, most_a_place):
    kept = np.empty(most, dtype=np.int64)
    images = np.empty((most, 4, 3))
    image = np.empty((4, 3))
    n = 0
    for number in order:
        _moved(R[number], t[number], probes[0], image)
        here = 0
        for k in range(n):
            here += _nearer(images[k, :1], image[:1], place)
        new = here < most_a_place
        for s in range(len(probes) if new and here > 0 else 0):
            _moved(R[number], t[number], probes[s], image)
            for k in range(n):
                if _nearer(images[k], image, apart):
                    new = False
                    break
            if not new:
                break
        if new:
            _moved(R[number], t[number], probes[0], images[n])
            kept[n] = number
            n += 1
            if n == most:
                break
    return kept[:n]
