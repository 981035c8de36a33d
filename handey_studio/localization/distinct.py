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
def _distinct(R, t, order, probes, apart, most, place, most_a_place):
    kept = np.empty(most, dtype=np.int64)
    images = np.empty((most, 4, 3))
    n = 0
    for number in order:
        middle = probes[0, 0] @ R[number].T + t[number]
        here = 0
        for k in range(n):
            here += np.sqrt(((images[k, 0] - middle) ** 2).sum()) < place
        new = here < most_a_place
        for s in range(len(probes) if new else 0):
            image = probes[s] @ R[number].T + t[number]
            for k in range(n):
                if np.sqrt(((images[k] - image) ** 2).sum(axis=1).max()) < apart:
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
