"""The depth that a solid would give: its triangles drawn into a view."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.sensing.depth_view import Orthographic, Pinhole

Camera = tuple[float, float, float, float, float]


def camera_of(projection: Pinhole | Orthographic) -> Camera:
    """What compiled code needs of a projection: 1 if parallel, scale x, scale y [px or px/m], cx, cy [px]."""
    if isinstance(projection, Pinhole):
        return 0.0, projection.fx, projection.fy, projection.cx, projection.cy
    return 1.0, 1.0 / projection.pixel, 1.0 / projection.pixel, projection.cx, projection.cy


def rendered_depth(corners_sensor: NDArray, triangles: NDArray, shape: tuple[int, int], camera: Camera) -> NDArray:
    """Depth (H, W) [m] of triangles (k, 3) over corners (n, 3) [m] in the sensor's frame; NaN where none is met.

    Corners must lie in front of the sensor; triangles that do not are left out.
    """
    out, drawn = np.full(shape, np.nan), np.full(shape, -1, dtype=np.int32)
    draw(np.ascontiguousarray(corners_sensor), np.ascontiguousarray(triangles), np.arange(len(triangles)), camera, 0, 0, out, drawn)
    return out


@njit(cache=True, error_model="numpy", inline="always")
def project(x, y, z, camera):
    """(u, v) [px] of a point in the sensor's frame."""
    if camera[0] > 0.5:
        return x * camera[1] + camera[3], y * camera[2] + camera[4]
    near = 1.0 / z
    return x * near * camera[1] + camera[3], y * near * camera[2] + camera[4]


@njit(cache=True)
def window(corners, camera, shape):
    """First pixel (u0, v0) and the one after the last (u1, v1) of the part of the view (height, width) that corners in front of the
    sensor lie in."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for n in range(len(corners)):
        if camera[0] > 0.5 or corners[n, 2] > 1e-6:
            u, v = project(corners[n, 0], corners[n, 1], corners[n, 2], camera)
            low[0], low[1] = min(low[0], u), min(low[1], v)
            high[0], high[1] = max(high[0], u), max(high[1], v)
    u0, v0 = int(min(max(np.floor(low[0]), 0), shape[1])), int(min(max(np.floor(low[1]), 0), shape[0]))
    u1, v1 = int(min(max(np.ceil(high[0]) + 1, u0), shape[1])), int(min(max(np.ceil(high[1]) + 1, v0), shape[0]))
    return u0, v0, u1, v1


@njit(cache=True, error_model="numpy")
def draw(corners, triangles, numbers, camera, u0, v0, out, drawn):
    """Draws triangles into `out` (H, W) [m], whose first pixel is (u0, v0) of the view, and their `numbers` into `drawn` (H, W); the
    nearest surface stays."""
    height, width = out.shape
    parallel = camera[0] > 0.5
    u, v, w = np.empty(3), np.empty(3), np.empty(3)
    for n in range(len(triangles)):
        ahead = True
        for k in range(3):
            x, y, z = corners[triangles[n, k]]
            ahead = ahead and (parallel or z > 1e-6)
            u[k], v[k] = project(x, y, z, camera)
            u[k], v[k] = u[k] - u0, v[k] - v0
            w[k] = z if parallel else 1.0 / z  # linear over the image
        area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0])
        if not ahead or abs(area) < 1e-12:
            continue
        ua, ub, uc, va, vb, vc, each = u[0], u[1], u[2], v[0], v[1], v[2], 1.0 / area
        first, last = max(0, int(np.ceil(u.min()))), min(width - 1, int(np.floor(u.max())))
        for j in range(max(0, int(np.ceil(v.min()))), min(height - 1, int(np.floor(v.max()))) + 1):
            for i in range(first, last + 1):
                a = ((ub - i) * (vc - j) - (uc - i) * (vb - j)) * each
                b = ((uc - i) * (va - j) - (ua - i) * (vc - j)) * each
                if a < 0.0 or b < 0.0 or a + b > 1.0:
                    continue
                value = a * w[0] + b * w[1] + (1.0 - a - b) * w[2]
                z = value if parallel else 1.0 / value
                if not out[j, i] <= z:
                    out[j, i], drawn[j, i] = z, numbers[n]
