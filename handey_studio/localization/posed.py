"""Points of a part at a pose: where they are, which way their faces look, and how the reading at their pixel stands to them."""

import numpy as np
from numba import njit

from handey_studio.localization.evidence import ray_at
from handey_studio.sensing.drawing import project

ON, HIDDEN, THROUGH, UNKNOWN = 0, 1, 2, 3
GRAZING = 0.12  # cosine; a face seen more edge-on than this gives no readings to count on


@njit(cache=True, error_model="numpy", inline="always")
def placed(R, t, points, k):
    """Point number k of a part at a pose."""
    x, y, z = points[k, 0], points[k, 1], points[k, 2]
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z + t[0],
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z + t[1],
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z + t[2],
    )


@njit(cache=True, error_model="numpy")
def turned(R, directions):
    """Directions (..., 3) of a part at a pose."""
    out = np.empty_like(directions)
    flat, into = directions.reshape(-1, 3), out.reshape(-1, 3)
    for k in range(len(flat)):
        for r in range(3):
            into[k, r] = R[r, 0] * flat[k, 0] + R[r, 1] * flat[k, 1] + R[r, 2] * flat[k, 2]
    return out


@njit(cache=True, error_model="numpy", inline="always")
def facing(nx, ny, nz, x, y, z, camera):
    """Cosine between a face's outward normal and the way back to the sensor, at a point of it."""
    rx, ry, rz = ray_at(x, y, z, camera)
    return -(nx * rx + ny * ry + nz * rz)


@njit(cache=True, error_model="numpy")
def reading_at(x, y, z, depth, camera, limits):
    """How the reading at a point's pixel stands to it (ON, HIDDEN, THROUGH, UNKNOWN), and how far behind it [m]."""
    u, v = project(x, y, z, camera)
    i, j = int(np.rint(u)), int(np.rint(v))
    if z <= 0.0 or i < 0 or j < 0 or i >= depth.shape[1] or j >= depth.shape[0]:
        return UNKNOWN, 0.0
    behind = depth[j, i] - z
    if np.isnan(behind):
        return UNKNOWN, 0.0
    if behind < -limits.hide:
        return HIDDEN, behind
    return (THROUGH if behind > limits.through else ON), behind
