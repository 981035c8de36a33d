"""Planes in small windows all over a depth image: what noise and support are found from."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.sensing.depth_view import Orthographic, Pinhole


def window_corners(shape: tuple[int, ...], side: int, count: int, least_step: int | None = None) -> tuple[NDArray, NDArray]:
    """First rows and columns of up to about `count` windows in even steps over an image, `least_step` [px] apart, else side by side."""
    height, width = shape
    if min(height, width) < side:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    step = max(least_step or side, int(np.ceil(np.sqrt(height * width / count))))
    tops, lefts = (np.arange((size - side) % step // 2, size - side + 1, step) for size in (height, width))
    return tops, lefts


def window_planes(found: NDArray, middles: NDArray, projection: Pinhole | Orthographic) -> tuple[NDArray, NDArray]:
    """Unit normals (n, 3) towards the sensor and offsets (n,) [m], normal · x = offset, of windows as `fit_windows` tells them.

    `middles` (n, 2) are their middles (u, v) [px].
    """
    value, along_u, along_v = found[:, 2:].T
    constant = value + along_u * (projection.cx - middles[:, 0]) + along_v * (projection.cy - middles[:, 1])
    if isinstance(projection, Pinhole):  # 1 = constant · z + along_u · fx · x + along_v · fy · y
        away = np.stack([along_u * projection.fx, along_v * projection.fy, constant], axis=1)
        size = np.linalg.norm(away, axis=1)
        return -away / size[:, None], -1.0 / size
    away = np.stack([-along_u / projection.pixel, -along_v / projection.pixel, np.ones(len(value))], axis=1)
    size = np.linalg.norm(away, axis=1)
    return -away / size[:, None], -constant / size


@njit(cache=True, error_model="numpy")
def fit_windows(depth: NDArray, tops: NDArray, lefts: NDArray, side: int, pinhole: bool, filled: float) -> NDArray:
    """Each window (n, 5) by rows: mean depth and standard deviation [m] off its plane, −1 where too few readings are left, and the plane.

    A plane is linear in the image in 1/depth for a pinhole, in depth for a parallel view: the last three are its value in the window's
    middle and its changes along u and v. Readings beyond three deviations are left out and the plane is fitted again. `tops` and
    `lefts` are the windows' first rows and columns, `filled` the share of its pixels that a window needs.
    """
    out = np.full((len(tops) * len(lefts), 5), -1.0)
    half = 0.5 * (side - 1)
    for n in range(len(out)):
        top, left = tops[n // len(lefts)], lefts[n % len(lefts)]
        gate, c0, cu, cv = np.inf, 0.0, 0.0, 0.0
        for again in range(4):
            m = error = total = su = sv = uu = uv = vv = q = qu = qv = 0.0
            for y in range(side):
                dv = y - half
                for x in range(side):
                    d = depth[top + y, left + x]
                    if not np.isfinite(d) or (pinhole and d <= 0.0):
                        continue
                    du = x - half
                    value = 1.0 / d if pinhole else d
                    plane = c0 + cu * du + cv * dv
                    e = (d - (1.0 / plane if pinhole else plane)) if again else 0.0
                    if abs(e) > gate:
                        continue
                    m, error, total = m + 1.0, error + e * e, total + d
                    su, sv, uu, uv, vv = su + du, sv + dv, uu + du * du, uv + du * dv, vv + dv * dv
                    q, qu, qv = q + value, qu + value * du, qv + value * dv
            if m < filled * side * side:
                break
            if again:
                out[n, 0], out[n, 1] = total / m, np.sqrt(error / (m - 3.0))
                gate = 3.0 * out[n, 1] + 1e-9
            uu, uv, vv = uu - su * su / m, uv - su * sv / m, vv - sv * sv / m
            qu, qv = qu - q * su / m, qv - q * sv / m
            det = uu * vv - uv * uv
            if det <= 1e-9:
                break
            cu, cv = (vv * qu - uv * qv) / det, (uu * qv - uv * qu) / det
            c0 = (q - cu * su - cv * sv) / m
            out[n, 2], out[n, 3], out[n, 4] = c0, cu, cv
    return out
