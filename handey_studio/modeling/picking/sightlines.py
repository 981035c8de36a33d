"""Where a line of sight meets the surface that a scan's readings span.

The line is followed through the scan's image in steps of half a pixel. Neighbouring readings of one surface span triangles, as they do for
depth maps; across a jump nothing is spanned, so no skirt hangs where nobody looked. Whoever looks from behind meets the surface too.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole
from handey_studio.sensing.view_map import STEEP_PX, STEEP_SIGMAS

STEP_PX = 0.5
NEAR_M, FAR_M = 0.01, 20.0  # how far along its line, and in front of the sensor, a surface is looked for


def meets_readings(view: DepthView, origin: NDArray, direction: NDArray) -> tuple[float, int, int] | None:
    """(distance [m], row, column) where a line of sight first meets the readings' surface; None if it does not.

    `origin` (3,) [m] and unit `direction` (3,) in the sensor's frame. Row and column are of the nearest reading.
    """
    ends = _within_image(view, origin, direction)
    if ends is None:
        return None
    parallel = isinstance(view.projection, Orthographic)
    pixel = 1.0 / float(view.projection.pixels_per_metre(1.0))
    share, v, u = _march(view.depth, *ends, STEEP_PX * pixel, STEEP_SIGMAS * view.noise, parallel)
    if share < 0.0:
        return None
    start, end = (ends[k][2] for k in (0, 1))
    depth_like = start + share * (end - start)
    point = view.projection.unproject(
        ends[0][:2] + share * (ends[1][:2] - ends[0][:2]), np.asarray(-depth_like if parallel else 1.0 / depth_like)
    )
    return float((point - origin) @ direction), int(v), int(u)


def _within_image(view: DepthView, origin: NDArray, direction: NDArray) -> tuple[NDArray, NDArray] | None:
    """The line's ends (u, v, w) inside the image; w grows towards the sensor and is linear along the line's image."""
    near, far = 0.0, FAR_M
    parallel = isinstance(view.projection, Orthographic)
    if not parallel:
        if abs(direction[2]) > 1e-12:
            there = (NEAR_M - origin[2]) / direction[2]
            near, far = (max(near, there), far) if direction[2] > 0 else (near, min(far, there))
        elif origin[2] < NEAR_M:
            return None
    if near >= far:
        return None
    points = origin + np.array([[near], [far]]) * direction
    w = -points[:, 2] if parallel else 1.0 / points[:, 2]
    ends = np.c_[view.projection.project(points), w]
    height, width = view.depth.shape
    low, high = 0.0, 1.0
    for axis, size in ((0, width), (1, height)):
        a, way = ends[0, axis], ends[1, axis] - ends[0, axis]
        if abs(way) < 1e-12:
            if not 0.0 <= a <= size - 1:
                return None
            continue
        first, last = sorted(((0.0 - a) / way, (size - 1 - a) / way))
        low, high = max(low, first), min(high, last)
    if low > high:
        return None
    return ends[0] + low * (ends[1] - ends[0]), ends[0] + high * (ends[1] - ends[0])


@njit(cache=True)
def _march(depth: NDArray, start: NDArray, end: NDArray, steep: float, noise: float, parallel: bool) -> tuple[float, int, int]:
    """The share of the way from start to end (u, v, w) where the surface is crossed, and the reading there; -1 if it is not."""
    way = end - start
    steps = max(1, int(np.ceil(max(abs(way[0]), abs(way[1])) / STEP_PX)))
    before, level = np.nan, np.nan
    for k in range(steps + 1):
        share = k / steps
        w = _surface(depth, start[0] + share * way[0], start[1] + share * way[1], steep, noise, parallel)
        gap = start[2] + share * way[2] - w
        one_surface = abs(w - level) <= _jump(w, steep, noise, parallel)
        if one_surface and ((before > 0.0) != (gap > 0.0)):
            low, high = (k - 1) / steps, share
            for _ in range(30):
                middle = 0.5 * (low + high)
                w = _surface(depth, start[0] + middle * way[0], start[1] + middle * way[1], steep, noise, parallel)
                if (start[2] + middle * way[2] - w > 0.0) == (before > 0.0):
                    low = middle
                else:
                    high = middle
            u, v = start[0] + high * way[0], start[1] + high * way[1]
            return high, min(depth.shape[0] - 1, int(np.rint(v))), min(depth.shape[1] - 1, int(np.rint(u)))
        before, level = gap, w
    return -1.0, -1, -1


@njit(cache=True)
def _jump(w: float, steep: float, noise: float, parallel: bool) -> float:
    """How much w may change from one step to the next on one surface."""
    if parallel:
        return steep + noise
    depth = 1.0 / w
    return (steep * depth + noise) * w * w


@njit(cache=True)
def _surface(depth: NDArray, u: float, v: float, steep: float, noise: float, parallel: bool) -> float:
    """w of the triangle of readings at a place of the image, NaN where there is none."""
    height, width = depth.shape
    i, j = min(max(int(np.floor(u)), 0), width - 2), min(max(int(np.floor(v)), 0), height - 2)
    s, t = u - i, v - j
    b, c = depth[j + 1, i], depth[j, i + 1]
    upper = s + t <= 1.0
    a = depth[j, i] if upper else depth[j + 1, i + 1]
    highest, lowest = max(a, b, c), min(a, b, c)
    scale = 1.0 if parallel else lowest
    if not (highest - lowest <= steep * scale + noise):
        return np.nan
    if not parallel:
        a, b, c = 1.0 / a, 1.0 / b, 1.0 / c
    else:
        a, b, c = -a, -b, -c
    return a + t * (b - a) + s * (c - a) if upper else a + (1.0 - t) * (c - a) + (1.0 - s) * (b - a)


def warm_up() -> None:
    """Load what is compiled, so that the first click is as quick as the next."""
    for projection in (Pinhole(2.0, 2.0, 1.0, 1.0), Orthographic(0.01, 1.0, 1.0)):
        meets_readings(DepthView(np.ones((3, 3)), projection), np.zeros(3), np.array([0.0, 0.0, 1.0]))
