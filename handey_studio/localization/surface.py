"""The surface that a view shows, pixel by pixel: its slope and normal, which stop at depth jumps.

A plane is fitted to the readings in a window about each pixel. Where one plane explains the whole window, which is nearly
everywhere, running sums give it at a cost that does not grow with the window. Only where it does not, near jumps and
sharp creases, are the readings gone through one by one to leave out what lies across.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.localization.shares import shared
from handey_studio.localization.window_planes import (
    MIN_SAMPLES,
    gated,
    over_windows,
    plane_through,
    take_row,
    take_window,
    whole_window,
    window_of,
)
from handey_studio.sensing.depth_view import DepthView
from handey_studio.sensing.drawing import Camera, camera_of

MAX_NORMAL_ERROR = 0.05  # rad; the window grows until the noise of a normal is below
MAX_RADIUS_PX = 6
TYPICAL_READINGS = 30_000
LEAST_ROWS = 32  # that are worth a share
ONE_PLANE = 1.6  # sigmas rms about a plane, up to which it is taken to explain the whole window
Noise = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Surface(Value):
    """`normals` (H, W, 3) in the sensor's frame, NaN where unknown; they look towards the sensor.

    `slope` (H, W, 2) [m/px] is the change of depth along u and v; `radius_px` that of the window; `pixel` [m] the size
    of a pixel across the view at its median depth; `typical` [m] that depth.
    """

    normals: NDArray
    slope: NDArray
    radius_px: int
    pixel: float
    typical: float

    def __post_init__(self) -> None:
        for key in ("normals", "slope"):
            object.__setattr__(self, key, frozen_array(getattr(self, key), np.float32))


def surface_of(view: DepthView) -> Surface:
    """The surface that a view shows: at each reading a normal and the slopes of depth, by least squares in a window around it.

    The window is as small as a normal's error of `MAX_NORMAL_ERROR` allows, and leaves out what lies across a jump; NaN where fewer than
    `MIN_SAMPLES` readings are left, or the surface is steeper than `MAX_SLOPE` of `window_planes`.
    """
    typical = _typical(view.depth)
    pixel = float(1.0 / view.projection.pixels_per_metre(typical))
    radius = window_radius(view.noise, pixel)
    camera, noise = camera_of(view.projection), (view.noise, typical)
    depth, step = np.asarray(view.depth), 2 if radius >= 4 else 1
    slope, normals = (np.full((*depth.shape, n), np.nan, dtype=np.float32) for n in (2, 3))
    shared(lambda first, last: _slopes(depth, camera, noise, radius, step, (first, last), slope, normals), len(depth), LEAST_ROWS)
    for array in (slope, normals):
        array.flags.writeable = False  # shared from here on, not copied
    return Surface(normals, slope, radius, pixel, typical)


def _typical(depth: NDArray) -> float:
    """The median [m] of a map's readings, or of enough of them; 1 if there are none."""
    for every in (max(1, int(np.sqrt(depth.size / TYPICAL_READINGS))), 1):
        readings = depth[::every, ::every]
        readings = readings[np.isfinite(readings)]
        if len(readings):
            return float(np.median(readings))
    return 1.0


def window_radius(noise: float, pixel: float) -> int:
    """Radius [px] of the window in which readings of that noise [m] give a normal good enough to find creases."""
    for radius in range(2, MAX_RADIUS_PX):
        if noise / (0.58 * radius * pixel * (2 * radius + 1)) < MAX_NORMAL_ERROR:
            return radius
    return MAX_RADIUS_PX


@njit(cache=True, inline="always")
def reading_sigma(d, camera, noise):
    """Standard deviation [m] of a reading at depth d: triangulated depth degrades with its square."""
    if camera[0] > 0.5:
        return noise[0]
    growth = d / noise[1]
    return noise[0] * max(growth * growth, 0.5)


@njit(cache=True, inline="always")
def pixel_size(d, camera):
    """Size [m] of a pixel across the view at depth d."""
    return 1.0 / camera[1] if camera[0] > 0.5 else d / camera[1]


@njit(cache=True, inline="always")
def unproject(u, v, d, camera):
    """Point in the sensor's frame at a pixel and depth."""
    reach = 1.0 if camera[0] > 0.5 else d
    return (u - camera[3]) / camera[1] * reach, (v - camera[4]) / camera[2] * reach, d


@njit(cache=True, error_model="numpy", inline="always")
def _normal(u, v, d, gu, gv, camera):
    """Unit normal towards the sensor: the cross product of the surface's steps along v and u."""
    x, y, step_x, step_y = (u - camera[3]) / camera[1], (v - camera[4]) / camera[2], 1.0 / camera[1], 1.0 / camera[2]
    if camera[0] > 0.5:
        ax, ay, bx, by = 0.0, step_y, step_x, 0.0
    else:
        ax, ay, bx, by = x * gv, y * gv + step_y * (d + gv), x * gu + step_x * (d + gu), y * gu
    nx, ny, nz = ay * gu - gv * by, gv * bx - ax * gu, ax * by - ay * bx
    scale = 1.0 / np.sqrt(nx * nx + ny * ny + nz * nz)
    return nx * scale, ny * scale, nz * scale


@njit(cache=True, nogil=True)
def _slopes(
    depth: NDArray, camera: Camera, noise: Noise, radius: int, step: int, rows: tuple[int, int], slopes: NDArray, normals: NDArray
) -> None:
    """Slopes (H, W, 2) [m/px] and normals (H, W, 3) of some rows, left as they are where there are too few readings."""
    height, width = depth.shape
    columns, sums = np.zeros((4, width)), np.zeros((5, max(width - 2 * radius, 0)))
    whole, coarse = window_of(radius, 1), window_of(radius, step)
    readings, fewer = np.empty(whole.shape[1]), np.empty(coarse.shape[1])
    for v in range(max(rows[0] - radius, 0), min(rows[0] + radius, height)):
        take_row(columns, depth, v, noise[1], 1.0)
    for v in range(rows[0], rows[1]):
        if v + radius < height:
            take_row(columns, depth, v + radius, noise[1], 1.0)
        if v - radius > max(rows[0] - radius, 0):
            take_row(columns, depth, v - radius - 1, noise[1], -1.0)
        over_windows(columns, v - 0.5 * height, radius, sums)
        inside = radius <= v < height - radius
        for u in range(width):
            d = depth[v, u]
            if np.isnan(d):
                continue
            k = u - radius
            if inside and 0 <= k < sums.shape[1] and sums[0, k] == 0.0:
                slope, n, squares, off = whole_window(sums, k, d - noise[1], radius)
            else:
                take_window(depth, v, u, radius, 1, readings)
                slope, n, squares, off = plane_through(readings, whole, np.inf, 0.0, (0.0, 0.0), np.inf, 0.0)
            sigma = reading_sigma(d, camera, noise)
            limit, known = ONE_PLANE * sigma, n >= 2 * MIN_SAMPLES
            if not (known and squares <= limit * limit * (n - 3.0) and abs(off) <= 3.0 * limit):
                take_window(depth, v, u, radius, step, fewer)
                slope, known = gated(fewer, coarse, pixel_size(d, camera), 4.0 * sigma)
            if known:
                slopes[v, u, 0], slopes[v, u, 1] = slope
                normals[v, u, 0], normals[v, u, 1], normals[v, u, 2] = _normal(u, v, d, slope[0], slope[1], camera)
