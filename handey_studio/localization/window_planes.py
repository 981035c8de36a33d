"""A plane through the readings in a window about a pixel: by running sums where one plane explains the whole window, else gated."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

MAX_SLOPE = 2.7  # tan 70°: steeper surfaces return too few readings to be told from a jump
MIN_SAMPLES = 5


@njit(cache=True, error_model="numpy", inline="always")
def _solve(n, su, sv, sd, suu, suv, svv, sud, svd):
    """Slopes along u and v of the plane with these sums, and whether they fix it."""
    suu, suv, svv = suu - su * su / n, suv - su * sv / n, svv - sv * sv / n
    sud, svd = sud - su * sd / n, svd - sv * sd / n
    det = suu * svv - suv * suv
    fixed = det >= 1e-3 * (suu + svv) ** 2 / 4 + 1e-12
    return ((svv * sud - suv * svd) / det, (suu * svd - suv * sud) / det, True) if fixed else (0.0, 0.0, False)


@njit(cache=True)
def window_of(radius: int, step: int) -> NDArray:
    """The pixels of a window, every `step`-th: rows of u, v, both counted from its middle, and the greater of them."""
    side = np.arange(-radius, radius + 1, step)
    out = np.empty((3, len(side) ** 2))
    for k in range(out.shape[1]):
        out[0, k], out[1, k] = side[k % len(side)], side[k // len(side)]
        out[2, k] = max(abs(out[0, k]), abs(out[1, k]))
    return out


@njit(cache=True)
def take_window(depth, v, u, radius, step, out):
    """The readings of a window, every `step`-th, less its middle's; NaN where there are none."""
    height, width = depth.shape
    within = radius <= v < height - radius and radius <= u < width - radius
    k, d = 0, depth[v, u]
    for y in range(v - radius, v + radius + 1, step):
        for x in range(u - radius, u + radius + 1, step):
            out[k] = depth[y, x] - d if within or (0 <= y < height and 0 <= x < width) else np.nan
            k += 1


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def plane_through(readings, window, gate, reach, slope, near, rough):
    """The plane through a window's readings that lie within `gate` + `reach` a pixel of the middle's and within `near` + `rough` a
    pixel of a plane of that slope: its slope, how many they are (0 if they fix none), the sum of their squares about it, and
    how far it misses the middle's."""
    n = su = sv = sd = suu = suv = svv = sud = svd = sdd = 0.0
    us, vs, rings = window[0], window[1], window[2]
    for k in range(len(readings)):
        e, du, dv, ring = readings[k], us[k], vs[k], rings[k]
        fits = (abs(e) <= gate + reach * ring) & (abs(e - slope[0] * du - slope[1] * dv) <= near + rough * ring)
        w, e = (1.0, e) if fits else (0.0, 0.0)
        n, su, sv, sd, sdd = n + w, su + w * du, sv + w * dv, sd + e, sdd + e * e
        suu, suv, svv = suu + w * du * du, suv + w * du * dv, svv + w * dv * dv
        sud, svd = sud + du * e, svd + dv * e
    gu, gv, fixed = _solve(n, su, sv, sd, suu, suv, svv, sud, svd)
    if n < MIN_SAMPLES or not fixed:
        return (0.0, 0.0), 0.0, 0.0, 0.0
    mean = sd / n
    squares = sdd - sd * mean - gu * (sud - su * mean) - gv * (svd - sv * mean)
    return (gu, gv), n, squares, mean - gu * su / n - gv * sv / n


@njit(cache=True)
def gated(readings, window, metres, gate):
    """Slope at a pixel by two rounds of least squares: first over all that may be connected, then over what fits the first."""
    reach = MAX_SLOPE * metres
    slope, n, _, _ = plane_through(readings, window, gate, reach, (0.0, 0.0), np.inf, 0.0)
    if n == 0.0:
        return slope, False
    again, n, _, _ = plane_through(readings, window, gate, reach, slope, gate, 0.15 * reach)
    return (again if n > 0.0 else slope), True


@njit(cache=True, error_model="numpy")
def take_row(columns, depth, row, reference, sign):
    """A row's readings into (or, with sign −1, out of) the sums of each column: holes, depth, v·depth, depth²."""
    y = row - 0.5 * depth.shape[0]
    holes, first, tilted, squares = columns[0], columns[1], columns[2], columns[3]
    readings = depth[row]
    for u in range(len(readings)):
        e = readings[u] - reference
        hole = np.isnan(e)
        e = 0.0 if hole else sign * e
        holes[u] += sign if hole else 0.0
        first[u] += e
        tilted[u] += y * e
        squares[u] += e * e * sign


@njit(cache=True, error_model="numpy")
def over_windows(columns, y, radius, sums):
    """The columns' sums added up over each window of a row, from the first that lies within the view: holes, depth, u·depth, v·depth,
    depth², with u and v counted from the window's middle, in row y."""
    inner = columns.shape[1] - 2 * radius
    sums[:] = 0.0
    for k in range(2 * radius + 1):
        holes, first, tilted, squares = columns[0, k:], columns[1, k:], columns[2, k:], columns[3, k:]
        for u in range(inner):
            sums[0, u] += holes[u]
            sums[1, u] += first[u]
            sums[2, u] += (k - radius) * first[u]
            sums[3, u] += tilted[u] - y * first[u]
            sums[4, u] += squares[u]


@njit(cache=True, error_model="numpy", inline="always")
def whole_window(sums, k, e, radius):
    """As `plane_through`, of all readings of a window without holes, from its sums; `e` is the middle's."""
    n = (2.0 * radius + 1.0) ** 2
    spread = n * radius * (radius + 1.0) / 3.0
    gu, gv, mean = sums[2, k] / spread, sums[3, k] / spread, sums[1, k] / n
    return (gu, gv), n, sums[4, k] - mean * sums[1, k] - (gu * gu + gv * gv) * spread, mean - e
