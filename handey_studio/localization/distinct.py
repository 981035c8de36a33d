"""Poses that are the same pose: near to one another, or differing by a symmetry of the part."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.world.part import Part


def distinct(R: NDArray, t: NDArray, order: NDArray, part: Part, apart: float, most: int) -> NDArray:
    """Numbers of poses R (n, 3, 3), t (n, 3), in the given order, that differ from all earlier ones by more than `apart` [m]
    at some point of the part; at most `most`."""
    return _distinct(R, t, order, probe_points(part), apart, most)


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
def _distinct(R, t, order, probes, apart, most):
    kept = np.empty(most, dtype=np.int64)
    images = np.empty((most, 4, 3))
    n = 0
    for number in order:
        new = True
        for s in range(len(probes)):
            here = probes[s] @ R[number].T + t[number]
            for k in range(n):
                if np.sqrt(((images[k] - here) ** 2).sum(axis=1).max()) < apart:
                    new = False
                    break
            if not new:
                break
        if new:
            images[n] = probes[0] @ R[number].T + t[number]
            kept[n] = number
            n += 1
            if n == most:
                break
    return kept[:n]
