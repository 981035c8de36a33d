"""How deep convex bodies overlap, and stand in the depth map's columns, all columns at once: separating axes.

The least shift that parts two convex polytopes is along a face normal of either or a cross product of their edges (Gottschalk, Lin &
Manocha 1996, OBBTree); leaving out one of these makes the answer larger, never smaller.
"""

from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.geometry import hull_triangles
from handey_studio.world.gjk import distance

MOST_EDGES = 48  # of a body with more edge directions the crosses are left out: it is nearly round
SAME = 1e-6  # directions nearer than this are one


class Directions:
    """Face normals (m, 3) and edge directions (e, 3) of a convex body, unit vectors in its own frame, opposite ones counted once."""

    def __init__(self, corners: NDArray) -> None:
        triangles = hull_triangles(corners)
        sides = corners[triangles[:, [1, 2, 0]]] - corners[triangles]
        self.normals = _unlike(np.cross(sides[:, 0], sides[:, 1]))
        edges = _unlike(sides.reshape(-1, 3))
        self.edges = edges if len(edges) <= MOST_EDGES else np.empty((0, 3))


@lru_cache(maxsize=256)
def _directions_of(data: bytes) -> Directions:
    return Directions(np.frombuffer(data).reshape(-1, 3))


def directions_of(corners: NDArray) -> Directions:
    """The directions of a body's corners (k, 3) [m], remembered."""
    return _directions_of(np.ascontiguousarray(corners, dtype=float).tobytes())


def _unlike(vectors: NDArray) -> NDArray:
    """The different directions among vectors (n, 3), as unit vectors, one of each opposite pair."""
    length = np.linalg.norm(vectors, axis=1)
    units = vectors[length > 1e-12] / length[length > 1e-12, None]
    first = np.argmax(np.abs(units) > SAME, axis=1)
    units = units * np.sign(units[np.arange(len(units)), first])[:, None]
    return units[np.unique(np.round(units / SAME).astype(np.int64), axis=0, return_index=True)[1]]


def depth(a: NDArray, of_a: Directions, R_a: NDArray, b: NDArray, of_b: Directions, R_b: NDArray) -> float:
    """Depth [m] that two bodies of corners (n, 3) and (m, 3) overlap by: the least shift that parts them; 0 when they are apart.

    `R_a`, `R_b` (3, 3) turn each one's own directions into the world.
    """
    crosses = np.cross((of_a.edges @ R_a.T)[:, None], (of_b.edges @ R_b.T)[None]).reshape(-1, 3)
    size = np.linalg.norm(crosses, axis=1)
    along = np.concatenate([of_a.normals @ R_a.T, of_b.normals @ R_b.T, crosses[size > 1e-6] / size[size > 1e-6, None]]).T
    one, other = a @ along, b @ along
    return max(0.0, float(np.minimum(one.max(axis=0) - other.min(axis=0), other.max(axis=0) - one.min(axis=0)).min()))


def column_depths(body: NDArray, directions: Directions, R: NDArray, columns: NDArray) -> NDArray:
    """Depth [m] (k,) that a body of corners (n, 3) stands in columns (k, 8, 3) of the depth map: the least shift that parts them,
    upwards or sideways; 0 where it does not. `R` (3, 3) turns the body's own directions into the world.

    Where in its cell a column's edge lies the map does not tell, so a body beside it may reach a cell into it and still only touch.
    The columns' corners are in the order in which z changes fastest and x slowest.
    """
    sides = columns[:, [4, 2, 1]] - columns[:, :1]
    lengths = np.linalg.norm(sides, axis=2)
    axes = sides[0] / lengths[0, :, None]
    crosses = np.cross((directions.edges @ R.T)[:, None], axes[None]).reshape(-1, 3)
    size = np.linalg.norm(crosses, axis=1)
    along = np.concatenate([axes, directions.normals @ R.T, crosses[size > 1e-6] / size[size > 1e-6, None]])
    mine, half = body @ along.T, lengths @ np.abs(axes @ along.T) / 2.0
    centre = columns.mean(axis=1) @ along.T
    shift = np.minimum(mine.max(axis=0) - centre + half, centre + half - mine.min(axis=0)).min(axis=1)
    lift = columns[:, :, 2].max(axis=1) - body[:, 2].min()
    return np.clip(np.minimum(lift, shift), 0.0, None)


@njit(cache=True)
def column_distances(body: NDArray, columns: NDArray, limit: float) -> NDArray:
    """Distance [m] (k,) of a body of corners (n, 3) to each of columns (k, 8, 3), 0 where they meet; some value ≥ `limit` beyond it."""
    flat = columns.reshape(-1, 3)
    out = np.empty(len(columns))
    for k in range(len(columns)):
        out[k] = distance(body, 0, len(body), flat, 8 * k, 8 * k + 8, limit)
    return out
