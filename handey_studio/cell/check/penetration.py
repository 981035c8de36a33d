"""How deep convex bodies overlap, exactly: by the separating axes of polytopes.

Two convex polytopes are apart exactly when some face normal of one, or some cross product of an edge of each, separates
them; when they overlap, the least overlap along those axes is the shortest way out. The simulated cell and the checker use
this; planners use FCL, so that neither judges itself.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.base import Value, frozen_array
from handey_studio.cell.bodies import SolidBody

SAME_DIRECTION = 1e-6


@dataclass(frozen=True, eq=False)
class Polytope(Value):
    """A convex piece in its body's frame: corners (n, 3) [m], face normals (f, 3) and edge directions (e, 3), up to sign."""

    corners: NDArray
    normals: NDArray
    edges: NDArray

    def __post_init__(self) -> None:
        for key in ("corners", "normals", "edges"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))


def polytope(corners: NDArray) -> Polytope:
    """The convex hull of corners (n, 3) [m]."""
    hull = ConvexHull(corners)
    normals = hull.equations[:, :3]
    edges = []
    for f, neighbours in enumerate(hull.neighbors):
        for k, g in enumerate(neighbours):
            if g > f and normals[f] @ normals[g] < 1 - SAME_DIRECTION**2:
                a, b = np.delete(hull.simplices[f], k)
                edges.append(corners[b] - corners[a])
    directions = np.array(edges) / np.linalg.norm(edges, axis=1, keepdims=True)
    return Polytope(corners[hull.vertices], _distinct(normals), _distinct(directions))


def _distinct(directions: NDArray) -> NDArray:
    """Directions without those that repeat, or turn round, an earlier one."""
    kept, count = np.empty_like(directions), 0
    for direction in directions:
        if not ((kept[:count] @ direction) ** 2 >= 1.0 - SAME_DIRECTION**2).any():
            kept[count] = direction
            count += 1
    return kept[:count]


@lru_cache(maxsize=256)
def body_polytopes(body: SolidBody) -> tuple[Polytope, ...]:
    """The exact convex pieces of a body, in its frame. Call with the body at the identity, so that one entry serves all poses."""
    return tuple(polytope(piece) for piece in body.pieces)


def polytopes_of(body: SolidBody) -> tuple[Polytope, ...]:
    """The exact convex pieces of a body, in its frame."""
    return body_polytopes(body.at(np.eye(4)))


def overlap(a: Polytope, T_world_a: NDArray, b: Polytope, T_world_b: NDArray) -> float:
    """Depth [m] by which two polytopes overlap; negative when they are apart, by at least that much."""
    R_a, R_b = T_world_a[:3, :3], T_world_b[:3, :3]
    normals_a, normals_b = a.normals @ R_a.T, b.normals @ R_b.T
    crossed = np.cross((a.edges @ R_a.T)[:, None], (b.edges @ R_b.T)[None]).reshape(-1, 3)
    lengths = np.linalg.norm(crossed, axis=1)
    crossed = crossed[lengths > SAME_DIRECTION] / lengths[lengths > SAME_DIRECTION, None]
    axes = np.concatenate([normals_a, normals_b, crossed])
    along_a = (a.corners @ R_a.T + T_world_a[:3, 3]) @ axes.T
    along_b = (b.corners @ R_b.T + T_world_b[:3, 3]) @ axes.T
    return float(np.minimum(along_a.max(axis=0) - along_b.min(axis=0), along_b.max(axis=0) - along_a.min(axis=0)).min())
