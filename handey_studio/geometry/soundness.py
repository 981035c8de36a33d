"""Whether a surface bounds a solid: every side meets its opposite once, and nothing passes through anything."""

import numpy as np
from numpy.typing import NDArray

AT_ONCE = 256  # edges: what is worked out for all triangles together should stay in the processor's caches


def unmatched_sides(sides: NDArray) -> tuple[NDArray, NDArray]:
    """Of directed sides (n, 2) as corner numbers: those whose opposite is missing (k, 2), and those that are there twice or more (j, 2)."""
    span = int(sides.max(initial=0)) + 1
    forward, backward = sides[:, 0] * span + sides[:, 1], sides[:, 1] * span + sides[:, 0]
    alone = ~np.isin(forward, backward)
    _, first, counts = np.unique(forward, return_index=True, return_counts=True)
    return np.unique(sides[alone], axis=0), sides[first[counts > 1]]


def crossings(corners: NDArray, triangles: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Where edges pass through the inside of triangles that they do not touch: points (k, 3) [m], the triangles (k,), the edges (k, 2).

    Corners (n, 3) [m]; triangles (m, 3) and edges as corner numbers.
    """
    sides = np.unique(np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1), axis=0)
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    reach = 1e-9 * np.linalg.norm(normals, axis=1)
    heights = (corners - corners[0]) @ normals.T - ((a - corners[0]) * normals).sum(axis=1)
    side_of = np.where(heights > reach, 1, np.where(heights < -reach, -1, 0)).astype(np.int8)
    found = [_through(side_of, triangles, sides[k : k + AT_ONCE], k) for k in range(0, len(sides), AT_ONCE)]
    edge, triangle = np.concatenate([np.empty((2, 0), dtype=int), *found], axis=1)
    p, q = corners[sides[edge, 0]], corners[sides[edge, 1]]
    d_p, d_q = heights[sides[edge, 0], triangle], heights[sides[edge, 1], triangle]
    points = p + (d_p / (d_p - d_q))[:, None] * (q - p)
    u, n = (a[triangle], b[triangle], c[triangle]), normals[triangle]
    inside = np.logical_and.reduce([np.einsum("ij,ij->i", np.cross(u[k - 2] - u[k], points - u[k]), n) > 0 for k in range(3)])
    return points[inside], triangle[inside], sides[edge[inside]]


def _through(side_of: NDArray, triangles: NDArray, sides: NDArray, first: int) -> NDArray:
    """Pairs (2, k) of an edge, numbered from `first`, and a triangle without its ends whose plane it passes through.

    `side_of` (n, m): on which side of the plane of each triangle each corner lies, 0 when it is in it.
    """
    edge, triangle = np.nonzero(side_of[sides[:, 0]] * side_of[sides[:, 1]] < 0)
    apart = (triangles[triangle][:, :, None] != sides[edge][:, None, :]).all(axis=(1, 2))
    return np.stack([edge[apart] + first, triangle[apart]])
