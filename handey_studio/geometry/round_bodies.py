"""Polytopes that hold round bodies, hardly larger and never smaller: collision knows corners only."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.base import frozen_array

ROUND_M = 0.0005  # a polytope stands out of the round body that it holds by at most this …
ROUND_SHARE = 0.01  # … or by this share of the radius, whichever is more
FEWEST, MOST = 8, 512


def cuboid(size: NDArray) -> NDArray:
    """Corners (8, 3) [m] of a cuboid of full size (3,) [m] about the origin; z changes fastest, x slowest."""
    return np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size


def cylinder(height: float, radius: float) -> NDArray:
    """Corners (2 n, 3) [m] of the prism around a cylinder about the origin, its axis along z."""
    n = max(FEWEST, int(np.ceil(np.pi / np.arccos(radius / (radius + _excess(radius))))))
    angles = 2 * np.pi * np.arange(n) / n
    rim = radius / np.cos(np.pi / n) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.concatenate([np.c_[rim, np.full(n, side * height)] for side in (-0.5, 0.5)])


def sphere(radius: float) -> NDArray:
    """Corners (n, 3) [m] of the polytope around a sphere about the origin."""
    n = FEWEST
    while n < MOST and _around(n)[1] > 1.0 + _excess(radius) / radius:
        n = int(n * 1.5)
    corners, reach = _around(n)
    return corners * reach * radius


def _excess(radius: float) -> float:
    return max(ROUND_M, ROUND_SHARE * radius)


@lru_cache(maxsize=16)
def _around(n: int) -> tuple[NDArray, float]:
    """n directions (n, 3) spread evenly along a spiral, and how far out they must stand for their hull to hold the unit sphere."""
    k = np.arange(n) + 0.5
    z, turn = 1 - 2 * k / n, np.pi * (1 + np.sqrt(5)) * k
    directions = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], axis=1)
    return frozen_array(directions), float(-1.0 / ConvexHull(directions).equations[:, 3].max())
