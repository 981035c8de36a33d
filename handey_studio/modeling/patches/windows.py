"""A plane at each reading: of all small windows that hold it, the one that lies flattest, so that edges do not blur."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.sensing.depth_view import DepthView, Pinhole
from handey_studio.sensing.facets import sigma_at

LEAST_SIDE_PX, MOST_SIDE_PX = 5, 15
NORMAL_RAD = 0.045  # a window is as large as it takes for its normal to be this good
FILLED = 0.5  # of its pixels
LEAST_SPREAD = 1e-6  # px⁴ a reading: less lie on a line


class Field(NamedTuple):
    """A view as images (H, W) in which a plane is linear: `value` is 1/depth for a pinhole, depth for a parallel view, NaN where there is
    no reading; `sigma` its standard deviation. `flat` (H, W, 4): the plane that each reading lies on, as value at pixel (0, 0) and
    changes along u and v, and the rms of its window by the noise; NaN where there is none."""

    value: NDArray
    sigma: NDArray
    flat: NDArray


def field_of(view: DepthView, wanted: NDArray) -> Field:
    """The readings `wanted` (H, W) with their planes."""
    depth = np.where(wanted, view.depth, np.nan)
    pinhole = isinstance(view.projection, Pinhole)
    sigma = noise_image(replace(view, depth=depth))
    if pinhole:
        with np.errstate(divide="ignore", invalid="ignore"):
            value, sigma = 1.0 / depth, sigma / depth**2
    else:
        value = depth
    half = _side(view) // 2
    flat = np.full((*depth.shape, 4), np.nan)
    rows, columns = np.nonzero(np.isfinite(value))
    if len(rows):
        top, left = max(0, rows.min() - half), max(0, columns.min() - half)
        part = np.s_[top : rows.max() + half + 1, left : columns.max() + half + 1]
        inner = np.ascontiguousarray(value[part]), np.ascontiguousarray(sigma[part])
        found = _flattest(*inner, _window_planes(*inner, half), half)
        found[..., 0] -= found[..., 1] * left + found[..., 2] * top
        flat[part] = found
    return Field(np.ascontiguousarray(value), np.ascontiguousarray(sigma), flat)


def noise_image(view: DepthView) -> NDArray:
    """Standard deviation (H, W) [m] of each reading, NaN where there is none."""
    known = np.isfinite(view.depth)
    sigma = np.full(view.depth.shape, np.nan)
    sigma[known] = sigma_at(view, view.depth[known])
    return sigma


def _side(view: DepthView) -> int:
    """An odd number of pixels."""
    middle = float(np.nanmedian(view.depth)) if np.isfinite(view.depth).any() else 1.0
    pixel = 1.0 / float(view.projection.pixels_per_metre(middle))
    side = int(np.ceil(np.sqrt(np.sqrt(12.0) * view.noise / (pixel * NORMAL_RAD))))
    return int(np.clip(side + 1 - side % 2, LEAST_SIDE_PX, MOST_SIDE_PX))


@njit(cache=True, error_model="numpy")
def _window_planes(value: NDArray, sigma: NDArray, half: int) -> NDArray:
    """Planes (H, W, 4) of the windows around all pixels, from sums over rectangles: value in the middle, changes, and rms by sigma."""
    height, width = value.shape
    sums = np.zeros((height + 1, width + 1, 9))
    middle, count = 0.0, 0
    for j in range(height):
        for i in range(width):
            if np.isfinite(value[j, i]):
                middle, count = middle + value[j, i], count + 1
    middle /= max(count, 1)
    row = np.zeros(9)
    for j in range(height):
        row[:] = 0.0
        for i in range(width):
            if np.isfinite(value[j, i]):
                q = value[j, i] - middle
                row[0] += 1.0
                row[1] += i
                row[2] += j
                row[3] += i * i
                row[4] += i * j
                row[5] += j * j
                row[6] += q
                row[7] += q * i
                row[8] += q * j
            for k in range(9):
                sums[j + 1, i + 1, k] = sums[j, i + 1, k] + row[k]
    return _planes_of_sums(value, sigma, sums, middle, half)


@njit(cache=True, error_model="numpy")
def plane_of_sums(s):
    """The least-squares plane of sums n, u, v, uu, uv, vv, q, qu, qv: value at pixel 0, changes along u and v; and how far the readings
    spread over an area, 0 for those on a line."""
    n, mu, mv, mq = s[0], s[1] / s[0], s[2] / s[0], s[6] / s[0]
    uu, uv, vv = s[3] - n * mu * mu, s[4] - n * mu * mv, s[5] - n * mv * mv
    qu, qv = s[7] - n * mq * mu, s[8] - n * mq * mv
    spread = uu * vv - uv * uv
    cu, cv = (vv * qu - uv * qv) / spread, (uu * qv - uv * qu) / spread
    return mq - cu * mu - cv * mv, cu, cv, spread


@njit(cache=True, error_model="numpy")
def _planes_of_sums(value, sigma, sums, middle, half):
    height, width = value.shape
    out = np.full((height, width, 4), np.nan)
    least = FILLED * (2 * half + 1) ** 2
    s = np.empty(9)
    for j in range(height):
        top, bottom = max(0, j - half), min(height, j + half + 1)
        for i in range(width):
            left, right = max(0, i - half), min(width, i + half + 1)
            for k in range(9):
                s[k] = sums[bottom, right, k] - sums[top, right, k] - sums[bottom, left, k] + sums[top, left, k]
            if s[0] < least or not np.isfinite(value[j, i]):
                continue
            c0, cu, cv, spread = plane_of_sums(s)
            if spread < LEAST_SPREAD * s[0]:
                continue
            off = 0.0
            for y in range(top, bottom):
                for x in range(left, right):
                    if np.isfinite(value[y, x]):
                        e = value[y, x] - middle - c0 - cu * x - cv * y
                        off += e * e
            out[j, i, 0] = middle + c0 + cu * i + cv * j
            out[j, i, 1], out[j, i, 2] = cu, cv
            out[j, i, 3] = np.sqrt(off / max(s[0] - 3.0, 1.0)) / sigma[j, i]
    return out


@njit(cache=True, error_model="numpy")
def _flattest(value: NDArray, sigma: NDArray, planes: NDArray, half: int) -> NDArray:
    """For each reading the flattest plane (H, W, 4) of the windows that hold it and whose plane it lies on, value at pixel (0, 0)."""
    height, width = value.shape
    out = np.full((height, width, 4), np.nan)
    step = max(1, half // 2)
    for j in range(height):
        for i in range(width):
            if not np.isfinite(value[j, i]):
                continue
            best = np.inf
            for y in range(j - 2 * step, j + 2 * step + 1, step):
                for x in range(i - 2 * step, i + 2 * step + 1, step):
                    if y < 0 or x < 0 or y >= height or x >= width or not planes[y, x, 3] < best:
                        continue
                    c, cu, cv = planes[y, x, 0], planes[y, x, 1], planes[y, x, 2]
                    if abs(value[j, i] - c - cu * (i - x) - cv * (j - y)) < 3.0 * sigma[j, i]:
                        best = planes[y, x, 3]
                        out[j, i, 0], out[j, i, 1], out[j, i, 2], out[j, i, 3] = c - cu * x - cv * y, cu, cv, best
    return out
