"""The depth that a part would give: its triangles drawn into the view."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.localization.evidence import project


def rendered_depth(corners_sensor: NDArray, triangles: NDArray, shape: tuple[int, int], camera: tuple[float, ...]) -> NDArray:
    """Depth (H, W) [m] of triangles (k, 3) over corners (n, 3) [m] in the sensor's frame; NaN where none is met.

    Corners must lie in front of the sensor; triangles that do not are left out.
    """
    return _draw(np.ascontiguousarray(corners_sensor), np.ascontiguousarray(triangles), shape[0], shape[1], camera)


@njit(cache=True)
def _draw(corners, triangles, height, width, camera):
    out = np.full((height, width), np.nan)
    parallel = camera[0] > 0.5
    u, v, w = np.empty(3), np.empty(3), np.empty(3)
    for n in range(len(triangles)):
        ahead = True
        for k in range(3):
            x, y, z = corners[triangles[n, k]]
            ahead = ahead and (parallel or z > 1e-6)
            u[k], v[k] = project(x, y, z, camera)
            w[k] = z if parallel else 1.0 / z  # linear over the image
        area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0])
        if not ahead or abs(area) < 1e-12:
            continue
        for j in range(max(0, int(np.ceil(v.min()))), min(height - 1, int(np.floor(v.max()))) + 1):
            for i in range(max(0, int(np.ceil(u.min()))), min(width - 1, int(np.floor(u.max()))) + 1):
                a = ((u[1] - i) * (v[2] - j) - (u[2] - i) * (v[1] - j)) / area
                b = ((u[2] - i) * (v[0] - j) - (u[0] - i) * (v[2] - j)) / area
                if a < 0.0 or b < 0.0 or a + b > 1.0:
                    continue
                value = a * w[0] + b * w[1] + (1.0 - a - b) * w[2]
                z = value if parallel else 1.0 / value
                if not out[j, i] <= z:
                    out[j, i] = z
    return out
