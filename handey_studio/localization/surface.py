"""The surface that a view shows, pixel by pixel: its slope and normal, which stop at depth jumps."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.sensing.depth_view import DepthView

MAX_NORMAL_ERROR = 0.05  # rad; the window grows until the noise of a normal is below
MAX_SLOPE = 2.7  # tan 70°: steeper surfaces return too few readings to be told from a jump
MIN_SAMPLES = 5
MAX_RADIUS_PX = 6


@dataclass(frozen=True, eq=False)
class Surface(Value):
    """`points` and `normals` (H, W, 3) in the sensor's frame, NaN where unknown; normals look towards the sensor.

    `slope` (H, W, 2) [m/px] is the change of depth along u and v; `radius_px` that of the window; `pixel` [m] the size
    of a pixel across the view at its median depth.
    """

    points: NDArray
    normals: NDArray
    slope: NDArray
    radius_px: int
    pixel: float

    def __post_init__(self) -> None:
        for key in ("points", "normals", "slope"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))


def surface_of(view: DepthView) -> Surface:
    """Normals by least squares in a window that leaves out what lies across a jump."""
    readings = view.depth[np.isfinite(view.depth)]
    pixel = float(1.0 / view.projection.pixels_per_metre(float(np.median(readings)) if len(readings) else 1.0))
    radius = window_radius(view.noise, pixel)
    step = 2 if radius >= 5 else 1
    metres = np.asarray(1.0 / view.projection.pixels_per_metre(view.depth))
    slope = _slopes(view.depth, metres, radius, step, 4.0 * view.noise, MAX_SLOPE)
    points = view.points_sensor()
    return Surface(points, _normals(view, points, slope), slope, radius, pixel)


def window_radius(noise: float, pixel: float) -> int:
    """Radius [px] of the window in which readings of that noise [m] give a normal good enough to find creases."""
    for radius in range(2, MAX_RADIUS_PX):
        if noise / (0.58 * radius * pixel * (2 * radius + 1)) < MAX_NORMAL_ERROR:
            return radius
    return MAX_RADIUS_PX


def _normals(view: DepthView, points: NDArray, slope: NDArray) -> NDArray:
    """From the slopes: the cross product of the surface's steps along v and u."""
    height, width = view.depth.shape
    v, u = np.mgrid[:height, :width].astype(float)
    uv = np.stack([u, v], axis=-1)
    along_u = view.projection.unproject(uv + np.array([1.0, 0.0]), view.depth + slope[..., 0]) - points
    along_v = view.projection.unproject(uv + np.array([0.0, 1.0]), view.depth + slope[..., 1]) - points
    normals = np.cross(along_v, along_u)
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


@njit(cache=True)
def _slopes(depth: NDArray, metres: NDArray, radius: int, step: int, gate: float, max_slope: float) -> NDArray:
    """(H, W, 2) [m/px] by two rounds of least squares: first over all that may be connected, then over what fits the first."""
    height, width = depth.shape
    slope = np.full((height, width, 2), np.nan)
    for v in range(height):
        for u in range(width):
            d = depth[v, u]
            if np.isnan(d):
                continue
            gu = gv = 0.0
            enough = False
            for again in range(2):
                n = su = sv = sd = suu = suv = svv = sud = svd = 0.0
                for dv in range(-radius, radius + 1, step):
                    for du in range(-radius, radius + 1, step):
                        y, x = v + dv, u + du
                        if y < 0 or x < 0 or y >= height or x >= width or np.isnan(depth[y, x]):
                            continue
                        e = depth[y, x] - d
                        reach = max_slope * metres[v, u] * max(abs(du), abs(dv))
                        if abs(e) > gate + reach or (again and abs(e - gu * du - gv * dv) > gate + 0.15 * reach):
                            continue
                        n += 1.0
                        su, sv, sd = su + du, sv + dv, sd + e
                        suu, suv, svv = suu + du * du, suv + du * dv, svv + dv * dv
                        sud, svd = sud + du * e, svd + dv * e
                if n < MIN_SAMPLES:
                    break
                suu, suv, svv = suu - su * su / n, suv - su * sv / n, svv - sv * sv / n
                sud, svd = sud - su * sd / n, svd - sv * sd / n
                det = suu * svv - suv * suv
                if det < 1e-3 * (suu + svv) ** 2 / 4 + 1e-12:
                    break
                gu, gv = (svv * sud - suv * svd) / det, (suu * svd - suv * sud) / det
                enough = True
            if enough:
                slope[v, u, 0], slope[v, u, 1] = gu, gv
    return slope
