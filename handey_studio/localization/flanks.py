"""The planes beside a straight run of edge pixels, fitted robustly along its whole length.

A plane in space is an affine function of the pixel in 1/z (pinhole) or z (parallel light); both are called w here. A
triangulating sensor's noise is even in w, too. Pixels are counted from a run's own frame: s along it, c across it [px].
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.localization.surface import Noise, reading_sigma, unproject
from handey_studio.sensing.drawing import Camera

COLUMNS = 64  # readings are taken from at most about this many places along a run
FEW = 12  # readings; fewer do not make a plane
ROUNDS = 4  # of fitting and growing
GATE = 3.0  # sigmas


class Seen(NamedTuple):
    """What compiled code needs of a view: `depth` (H, W) [m], `slope` (H, W, 2) [m/px], the window's `radius` [px], the
    `outline` error [m]."""

    depth: NDArray
    slope: NDArray
    camera: Camera
    noise: Noise
    radius: int
    outline: float


class Run(NamedTuple):
    """A straight run of pixels: its middle (u, v) [px], unit direction (du, dv), half its length [px]."""

    u: float
    v: float
    du: float
    dv: float
    half: float


@njit(cache=True, inline="always")
def w_of(d, camera):
    """w of a depth [m], and the depth of a w."""
    return d if camera[0] > 0.5 else 1.0 / d


@njit(cache=True, inline="always")
def w_sigma(d, camera, noise):
    """Standard deviation of a reading's w at depth d."""
    sigma = reading_sigma(d, camera, noise)
    return sigma if camera[0] > 0.5 else sigma / (d * d)


@njit(cache=True)
def space_point(run, s, c, w, camera):
    """Point (3,) in the sensor's frame of a place in a run's frame."""
    d = w_of(w, camera)
    x, y, z = unproject(run.u + s * run.du - c * run.dv, run.v + s * run.dv + c * run.du, d, camera)
    return np.array([x, y, z])


@njit(cache=True)
def space_normal(run, plane, camera):
    """Unit normal (3,) towards the sensor of the plane w = a + b·s + c·c."""
    wu, wv = plane[1] * run.du - plane[2] * run.dv, plane[1] * run.dv + plane[2] * run.du
    if camera[0] > 0.5:
        n = np.array([wu * camera[1], wv * camera[2], -1.0])
    else:
        n = -np.array([wu * camera[1], wv * camera[2], plane[0] - wu * (run.u - camera[3]) - wv * (run.v - camera[4])])
    return n / np.sqrt(np.sum(n * n))


@njit(cache=True, error_model="numpy")
def _gather(seen: Seen, run: Run, side: float, inner: float, outer: float) -> NDArray:
    """Readings on one side of a run, at c from `inner` to `outer`: rows of s, |c|, w, dw/ds, dw/d|c|, column; each pixel once."""
    height, width = seen.depth.shape
    flat = abs(run.du) >= abs(run.dv)
    main, cross = (run.du, run.dv) if flat else (run.dv, run.du)
    middle, level = (run.u, run.v) if flat else (run.v, run.u)
    reach = run.half * abs(main)
    first, last = int(np.ceil(middle - reach)), int(np.floor(middle + reach))
    stride = max(1, (last - first) // COLUMNS)
    upward = side * (main if flat else -main)  # how |c| changes with the cross coordinate
    count = int((outer - inner) / abs(main)) + 2
    out = np.empty((((last - first) // stride + 1) * count, 6))
    n = 0
    for i in range(first, last + 1, stride):
        line = level + (i - middle) * cross / main
        start = line + inner / upward
        j = int(np.ceil(start)) if upward > 0 else int(np.floor(start))
        for _ in range(count):
            c = (j - line) * upward
            y, x = (j, i) if flat else (i, j)
            j += 1 if upward > 0 else -1
            if c > outer or x < 0 or y < 0 or x >= width or y >= height:
                continue
            d = seen.depth[y, x]
            if np.isnan(d):
                continue
            scale = 1.0 if seen.camera[0] > 0.5 else -1.0 / (d * d)
            gu, gv = scale * seen.slope[y, x, 0], scale * seen.slope[y, x, 1]
            out[n, 0] = (x - run.u) * run.du + (y - run.v) * run.dv
            out[n, 1] = c
            out[n, 2] = w_of(d, seen.camera)
            out[n, 3] = gu * run.du + gv * run.dv
            out[n, 4] = side * (gv * run.du - gu * run.dv)
            out[n, 5] = i
            n += 1
    return out[:n]


@njit(cache=True)
def _seed(rows: NDArray, low: float, high: float, plane: NDArray) -> int:
    """A first plane from the windows' slopes at c from `low` to `high`: medians. How many readings it comes from."""
    n = 0
    values, chosen = np.empty((3, len(rows))), np.empty(len(rows), dtype=np.int64)
    for k in range(len(rows)):
        if low <= rows[k, 1] <= high and not np.isnan(rows[k, 3]):
            values[0, n], values[1, n], chosen[n] = rows[k, 3], rows[k, 4], k
            n += 1
    if n < FEW // 2:
        return 0
    plane[1], plane[2] = np.median(values[0, :n]), np.median(values[1, :n])
    for i in range(n):
        k = chosen[i]
        values[2, i] = rows[k, 2] - plane[1] * rows[k, 0] - plane[2] * rows[k, 1]
    plane[0] = np.median(values[2, :n])
    return n


@njit(cache=True, error_model="numpy")
def _reach(rows: NDArray, plane: NDArray, gate: float, outer: float) -> float:
    """Up to which c the readings keep to the plane: until most of those at one distance do not."""
    bands = int(outer) + 1
    known, good = np.zeros(bands), np.zeros(bands)
    w, along, across = plane[0], plane[1], plane[2]
    for k in range(len(rows)):
        band = min(int(rows[k, 1]), bands - 1)
        known[band] += 1.0
        good[band] += abs(rows[k, 2] - w - along * rows[k, 0] - across * rows[k, 1]) <= gate
    for band in range(2, bands):
        if good[band] < 0.6 * known[band] or known[band] < 0.2 * known.max():
            return float(band)
    return outer


@njit(cache=True, error_model="numpy")
def _inverse(n: float, s: float, c: float, ss: float, sc: float, cc: float) -> tuple[NDArray, float]:
    """The inverse of a symmetric matrix by its rows, and its determinant as a share of what the diagonal alone would make."""
    a, b, d = ss * cc - sc * sc, c * sc - s * cc, s * sc - c * ss
    determinant = n * a + s * b + c * d
    adjugate = np.array([[a, b, d], [b, n * cc - c * c, s * c - n * sc], [d, s * c - n * sc, n * ss - s * s]])
    return adjugate / determinant, determinant / (n * ss * cc)


@njit(cache=True, error_model="numpy")
def _fit(rows: NDArray, plane: NDArray, gate: float, reach: float) -> tuple[int, NDArray, float, float]:
    """The plane moved to the least squares of the readings within the gate and reach; their number, the inverse of the normal
    matrix, the mean square residual and how much neighbours' residuals resemble one another (0 to 1)."""
    w, along, across = plane[0], plane[1], plane[2]
    n = 0
    squares = alike = es = ec = ew = s1 = c1 = ss = sc = cc = 0.0
    before, column = 0.0, -1.0
    for k in range(len(rows)):
        s, c = rows[k, 0], rows[k, 1]
        if c > reach:
            continue
        e = rows[k, 2] - w - along * s - across * c
        if abs(e) > gate:
            column = -1.0
            continue
        n += 1
        squares += e * e
        if column == rows[k, 5]:
            alike += e * before
        before, column = e, rows[k, 5]
        ew, es, ec = ew + e, es + s * e, ec + c * e
        s1, c1, ss, sc, cc = s1 + s, c1 + c, ss + s * s, sc + s * c, cc + c * c
    inverse, share = _inverse(float(n), s1, c1, ss, sc, cc)
    if n < FEW or share < 1e-6:
        return 0, inverse, 0.0, 0.0
    for k in range(3):
        plane[k] += inverse[k, 0] * ew + inverse[k, 1] * es + inverse[k, 2] * ec
    return n, inverse, squares / n, min(max(alike / max(squares, 1e-30), 0.0), 0.8)


@njit(cache=True)
def flank(seen: Seen, run: Run, side: float, inner: float, seed_from: float) -> tuple[int, NDArray, NDArray]:
    """The plane on one side of a run (+1 where c is positive): number of readings (0: there is none), the plane's (3,) w, dw/ds,
    dw/dc in the run's frame, and their covariance (3, 3), from the noise, the residuals and how they hang together."""
    outer = 3.0 * seen.radius + 3.0
    rows = _gather(seen, run, side, inner, outer)
    plane, covariance = np.zeros(3), np.zeros((3, 3))
    if _seed(rows, seed_from, seed_from + 3.0, plane) == 0:
        return 0, plane, covariance
    sigma = w_sigma(w_of(plane[0], seen.camera), seen.camera, seen.noise)
    reach, spread, n = seed_from + 3.0, sigma, 0
    for again in range(ROUNDS):
        n, inverse, variance, alike = _fit(rows, plane, (GATE + 1.0 if again == 0 else GATE) * spread, reach)
        if n == 0:
            return 0, plane, covariance
        spread = min(max(sigma, np.sqrt(variance)), 2.0 * sigma)
        reach = _reach(rows, plane, GATE * spread, outer)
        grown = (1.0 + alike) / (1.0 - alike)
        covariance = inverse * max(sigma * sigma, variance) * grown * grown
    if n < 0.5 * np.sum(rows[:, 1] <= reach):
        return 0, plane, covariance
    plane[2] *= side
    covariance[2] *= side
    covariance[:, 2] *= side
    return n, plane, covariance
