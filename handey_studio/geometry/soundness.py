"""Whether a surface bounds a solid: every side meets its opposite once, and nothing passes through anything."""

import numpy as np
from numpy.typing import NDArray


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
    points, pierced, through = [np.empty((0, 3))], [np.empty(0, dtype=int)], []
    for side in sides:
        p, q = corners[side]
        d_p, d_q = ((p - a) * normals).sum(axis=1), ((q - a) * normals).sum(axis=1)
        maybe = (d_p * d_q < 0) & (np.abs(d_p) > reach) & (np.abs(d_q) > reach)
        maybe &= ~((triangles == side[0]) | (triangles == side[1])).any(axis=1)
        if maybe.any():
            t = (d_p[maybe] / (d_p[maybe] - d_q[maybe]))[:, None]
            x = p + t * (q - p)
            n = normals[maybe]
            u = (a[maybe], b[maybe], c[maybe])
            inside = np.logical_and.reduce([np.einsum("ij,ij->i", np.cross(u[k - 2] - u[k], x - u[k]), n) > 0 for k in range(3)])
            points.append(x[inside])
            pierced.append(np.nonzero(maybe)[0][inside])
            through += [side] * int(inside.sum())
    return np.concatenate(points), np.concatenate(pierced), np.array(through, dtype=int).reshape(-1, 2)
