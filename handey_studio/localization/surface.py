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
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole

MAX_NORMAL_ERROR = 0.05  # rad; the window grows until the noise of a normal is below
MAX_SLOPE = 2.7  # tan 70°: steeper surfaces return too few readings to be told from a jump
MIN_SAMPLES = 5
MAX_RADIUS_PX = 6
ONE_PLANE = 1.6  # sigmas rms about a plane, up to which it is taken to explain the whole window

Camera = tuple[float, float, float, float, float]
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
    """Normals by least squares in a window that leaves out what lies across a jump."""
    readings = view.depth[np.isfinite(view.depth)]
    typical = float(np.median(readings)) if len(readings) else 1.0
    pixel = float(1.0 / view.projection.pixels_per_metre(typical))
    radius = window_radius(view.noise, pixel)
    camera, noise = camera_of(view.projection), (view.noise, typical)
    slope, normals = _slopes(np.asarray(view.depth), camera, noise, radius, 2 if radius >= 4 else 1)
    for array in (slope, normals):
        array.flags.writeable = False  # shared from here on, not copied
    return Surface(normals, slope, radius, pixel, typical)


def window_radius(noise: float, pixel: float) -> int:
    """Radius [px] of the window in which readings of that noise [m] give a normal good enough to find creases."""
    for radius in range(2, MAX_RADIUS_PX):
        if noise / (0.58 * radius * pixel * (2 * radius + 1)) < MAX_NORMAL_ERROR:
            return radius
    return MAX_RADIUS_PX


def camera_of(projection: Pinhole | Orthographic) -> Camera:
    """What compiled code needs of a projection: 1 if parallel, scale x, scale y [px or px/m], cx, cy [px]."""
    if isinstance(projection, Pinhole):
        return 0.0, projection.fx, projection.fy, projection.cx, projection.cy
    return 1.0, 1.0 / projection.pixel, 1.0 / projection.pixel, projection.cx, projection.cy


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


@njit(cache=True)
def _normal(u, v, d, gu, gv, camera):
    """Unit normal towards the sensor: the cross product of the surface's steps along v and u."""
    x0, y0, _ = unproject(u, v, d, camera)
    x1, y1, _ = unproject(u + 1.0, v, d + gu, camera)
    x2, y2, _ = unproject(u, v + 1.0, d + gv, camera)
    ax, ay, bx, by = x2 - x0, y2 - y0, x1 - x0, y1 - y0
    nx, ny, nz = ay * gu - gv * by, gv * bx - ax * gu, ax * by - ay * bx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    return nx / length, ny / length, nz / length


@njit(cache=True)
def _solve(n, su, sv, sd, suu, suv, svv, sud, svd):
    """Slopes along u and v of the plane with these sums, and whether they fix it."""
    suu, suv, svv = suu - su * su / n, suv - su * sv / n, svv - sv * sv / n
    sud, svd = sud - su * sd / n, svd - sv * sd / n
    det = suu * svv - suv * suv
    if det < 1e-3 * (suu + svv) ** 2 / 4 + 1e-12:
        return 0.0, 0.0, False
    return (svv * sud - suv * svd) / det, (suu * svd - suv * sud) / det, True


@njit(cache=True)
def _gated(depth, v, u, metres, radius, step, gate):
    """Slope at a pixel by two rounds of least squares: first over all that may be connected, then over what fits the first."""
    height, width = depth.shape
    d = depth[v, u]
    gu = gv = 0.0
    known = False
    for again in range(2):
        n = su = sv = sd = suu = suv = svv = sud = svd = 0.0
        for dv in range(-radius, radius + 1, step):
            y = v + dv
            if y < 0 or y >= height:
                continue
            for du in range(-radius, radius + 1, step):
                x = u + du
                if x < 0 or x >= width:
                    continue
                e = depth[y, x] - d
                reach = MAX_SLOPE * metres * max(abs(du), abs(dv))
                if not abs(e) <= gate + reach or (again and abs(e - gu * du - gv * dv) > gate + 0.15 * reach):
                    continue
                n += 1.0
                su, sv, sd = su + du, sv + dv, sd + e
                suu, suv, svv = suu + du * du, suv + du * dv, svv + dv * dv
                sud, svd = sud + du * e, svd + dv * e
        if n < MIN_SAMPLES:
            break
        a, b, fixed = _solve(n, su, sv, sd, suu, suv, svv, sud, svd)
        if not fixed:
            break
        gu, gv, known = a, b, True
    return gu, gv, known


@njit(cache=True)
def _take_row(columns, depth, row, reference, sign):
    """A row's readings into (or, with sign −1, out of) the sums of each column: n, v, v², depth, v·depth, depth²."""
    y = row - 0.5 * depth.shape[0]
    for u in range(depth.shape[1]):
        e = depth[row, u] - reference
        if not np.isnan(e):
            c = columns[u]
            c[0] += sign
            c[1] += sign * y
            c[2] += sign * y * y
            c[3] += sign * e
            c[4] += sign * y * e
            c[5] += sign * e * e


@njit(cache=True)
def _take_column(sums, c, x, sign):
    """A column's sums into (or out of) the window's: n, u, v, depth, u², uv, v², u·depth, v·depth, depth²."""
    sums[0] += sign * c[0]
    sums[1] += sign * x * c[0]
    sums[2] += sign * c[1]
    sums[3] += sign * c[3]
    sums[4] += sign * x * x * c[0]
    sums[5] += sign * x * c[1]
    sums[6] += sign * c[2]
    sums[7] += sign * x * c[3]
    sums[8] += sign * c[4]
    sums[9] += sign * c[5]


@njit(cache=True)
def _one_plane(s, u, v, e, sigma):
    """Slope of the plane through a window's readings, and whether it explains them all, the pixel's own `e` among them."""
    n = s[0]
    gu, gv, fixed = _solve(n, s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8])
    if not fixed or n < 2 * MIN_SAMPLES:
        return gu, gv, False
    mean = s[3] / n
    squares = s[9] - s[3] * mean - gu * (s[7] - s[1] * mean) - gv * (s[8] - s[2] * mean)
    off = e - mean - gu * (u - s[1] / n) - gv * (v - s[2] / n)
    limit = ONE_PLANE * sigma
    return gu, gv, squares <= limit * limit * (n - 3.0) and abs(off) <= 3.0 * limit


@njit(cache=True)
def _slopes(depth: NDArray, camera: Camera, noise: Noise, radius: int, step: int) -> tuple[NDArray, NDArray]:
    """Slopes (H, W, 2) [m/px] and normals (H, W, 3), NaN where there are too few readings."""
    height, width = depth.shape
    slope = np.full((height, width, 2), np.nan, dtype=np.float32)
    normals = np.full((height, width, 3), np.nan, dtype=np.float32)
    columns, sums = np.zeros((width, 6)), np.zeros(10)
    reference = noise[1]
    for v in range(min(radius, height)):
        _take_row(columns, depth, v, reference, 1.0)
    for v in range(height):
        if v + radius < height:
            _take_row(columns, depth, v + radius, reference, 1.0)
        if v - radius > 0:
            _take_row(columns, depth, v - radius - 1, reference, -1.0)
        sums[:] = 0.0
        for u in range(min(radius, width)):
            _take_column(sums, columns[u], u - 0.5 * width, 1.0)
        for u in range(width):
            if u + radius < width:
                _take_column(sums, columns[u + radius], u + radius - 0.5 * width, 1.0)
            if u - radius > 0:
                _take_column(sums, columns[u - radius - 1], u - radius - 1 - 0.5 * width, -1.0)
            d = depth[v, u]
            if np.isnan(d):
                continue
            sigma = reading_sigma(d, camera, noise)
            gu, gv, known = _one_plane(sums, u - 0.5 * width, v - 0.5 * height, d - reference, sigma)
            if not known:
                gu, gv, known = _gated(depth, v, u, pixel_size(d, camera), radius, step, 4.0 * sigma)
            if known:
                slope[v, u, 0], slope[v, u, 1] = gu, gv
                normals[v, u, 0], normals[v, u, 1], normals[v, u, 2] = _normal(u, v, d, gu, gv, camera)
    return slope, normals
