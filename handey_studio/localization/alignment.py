"""Laying model edges onto data edges: the frames that they make, and whether the faces beside them agree (Handey 1987 §3)."""

import numpy as np
from numba import njit

from handey_studio.localization.edges import CONVEX


@njit(cache=True)
def frame_of_pair(u, w, out):
    """Columns: the bisector of two unit directions, the third axis, and their common normal."""
    nx, ny, nz = u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    bx, by, bz = u[0] + w[0], u[1] + w[1], u[2] + w[2]
    size = np.sqrt(bx * bx + by * by + bz * bz)
    out[0, 0], out[1, 0], out[2, 0] = bx / size, by / size, bz / size
    out[0, 2], out[1, 2], out[2, 2] = nx / length, ny / length, nz / length
    out[0, 1] = out[1, 2] * out[2, 0] - out[2, 2] * out[1, 0]
    out[1, 1] = out[2, 2] * out[0, 0] - out[0, 2] * out[2, 0]
    out[2, 1] = out[0, 2] * out[1, 0] - out[1, 2] * out[0, 0]


@njit(cache=True)
def axes_of(along, across, out):
    """Columns: a direction, one made square to it, and their common normal."""
    dot = along[0] * across[0] + along[1] * across[1] + along[2] * across[2]
    x, y, z = across[0] - dot * along[0], across[1] - dot * along[1], across[2] - dot * along[2]
    size = np.sqrt(x * x + y * y + z * z)
    for r in range(3):
        out[r, 0] = along[r]
    out[0, 1], out[1, 1], out[2, 1] = x / size, y / size, z / size
    out[0, 2] = along[1] * out[2, 1] - along[2] * out[1, 1]
    out[1, 2] = along[2] * out[0, 1] - along[0] * out[2, 1]
    out[2, 2] = along[0] * out[1, 1] - along[1] * out[0, 1]


@njit(cache=True)
def flanks_agree(R, edges, m, lines, i, sign, limit):
    """Whether the surfaces beside data edge i, taken in direction `sign`, are the faces beside model edge m.

    A crease between the part and what it touches shows one face of the part, a jump shows one, a convex crease two.
    """
    agree = known = 0
    for k in range(2):
        side = lines.side[i, k] * sign
        if side == 0.0:
            continue
        known += 1
        normal = edges.left[m] if side > 0 else edges.right[m]
        dot = 0.0
        for r in range(3):
            dot += lines.flank[i, k, r] * (R[r, 0] * normal[0] + R[r, 1] * normal[1] + R[r, 2] * normal[2])
        agree += dot > limit
    needed = 2 if (lines.kind[i] == CONVEX or edges.concave[m]) else 1
    return known == 0 or agree >= min(needed, known)
