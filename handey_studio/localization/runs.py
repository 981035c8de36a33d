"""Edge pixels as a straight run in the image, silhouettes at sub-pixel places, and the level of a run by its own readings."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.localization.flanks import Run, Seen, w_of
from handey_studio.localization.surface import pixel_size

MIN_PIXELS = 10
TRIM = 2.5  # sigmas; rounds of trimming take the corners' rounding off a run
MIN_PLACES = 6  # along a silhouette
STEP_SIGMA = 0.29  # px; of a place known to lie somewhere within one pixel
RAGGED_PX = 1.5  # what a sensor loses beyond this at silhouettes it loses all along them


@njit(cache=True)
def axis_of(u: NDArray, v: NDArray, keep: NDArray) -> tuple[float, float, float, float, float]:
    """Middle (u, v), unit direction and rms [px] across of kept pixels, by total least squares."""
    n = max(keep.sum(), 1)
    mu, mv = np.sum(u[keep]) / n, np.sum(v[keep]) / n
    a, b = u[keep] - mu, v[keep] - mv
    suu, suv, svv = np.sum(a * a), np.sum(a * b), np.sum(b * b)
    angle = 0.5 * np.arctan2(2.0 * suv, suu - svv)
    du, dv = np.cos(angle), np.sin(angle)
    across = b * du - a * dv
    return mu, mv, du, dv, np.sqrt(np.sum(across * across) / n)


@njit(cache=True)
def _beyond(depth, v, u, dv, du, most):
    """How many pixels on the next reading that way is, at most `most` + 1."""
    y, x = v + dv, u + du
    for k in range(1, most + 1):
        if y < 0 or x < 0 or y >= depth.shape[0] or x >= depth.shape[1]:
            return most + 1
        if not np.isnan(depth[y, x]):
            return k
        y, x = y + dv, x + du
    return most + 1


@njit(cache=True)
def outline(seen: Seen, outward: NDArray, u: NDArray, v: NDArray) -> tuple[NDArray, NDArray, NDArray, float]:
    """Where a silhouette lies (u, v) [px], beyond its last readings, which of them tell, and how far all of it may be off.

    Along the image axis that crosses it, it lies anywhere between the last reading and the next, so half a pixel on; in a
    hole no farther than sensors lose readings there.
    """
    _, _, du, dv, _ = axis_of(u, v, np.ones(len(u), dtype=np.bool_))
    axis = 1 if abs(du) >= abs(dv) else 0
    total = 0
    for i in range(len(u)):
        total += outward[int(v[i]), int(u[i]), axis]
    sign = 1 if total >= 0 else -1
    lost = seen.outline / pixel_size(seen.depth[int(v[0]), int(u[0])], seen.camera)
    x, y, tells = u.copy(), v.copy(), np.zeros(len(u), dtype=np.bool_)
    systematic = 0.0
    for i in range(len(u)):
        out = outward[int(v[i]), int(u[i]), axis] * sign
        tells[i] = out > 0
        k = _beyond(seen.depth, int(v[i]), int(u[i]), sign * axis, sign * (1 - axis), 3 + int(2.0 * lost))
        on = min(0.5 * k, 0.5 + 0.2 * lost)
        systematic += min(STEP_SIGMA * (k - 1), 0.4 * lost) + min(0.5 * lost, max(lost - RAGGED_PX, 0.0))
        x[i] += sign * (1 - axis) * on
        y[i] += sign * axis * on
    _nearest_only(seen.depth, u, v, v if axis == 0 else u, tells)
    return x, y, tells, systematic / len(u)


@njit(cache=True)
def _nearest_only(depth: NDArray, u: NDArray, v: NDArray, place: NDArray, tells: NDArray) -> None:
    """Leaves one pixel at each place along a silhouette, the nearest: a face seen edge-on is a band of jumps behind its own edge."""
    first = int(place.min())
    best = np.full(int(place.max()) - first + 1, -1)
    for i in range(len(u)):
        k = int(place[i]) - first
        if tells[i] and (best[k] < 0 or depth[int(v[i]), int(u[i])] < depth[int(v[best[k]]), int(u[best[k]])]):
            best[k] = i
    tells[:] = False
    for k in best:
        if k >= 0:
            tells[k] = True


@njit(cache=True)
def straight_run(x: NDArray, y: NDArray, tells: NDArray, least: int) -> tuple[Run, NDArray, float]:
    """The run through pixels, which of them keep to it, and their rms off it [px]."""
    keep = tells.copy()
    mu, mv, du, dv, rms = axis_of(x, y, keep)
    for _ in range(3):
        across = (y - mv) * du - (x - mu) * dv
        keep = tells & (np.abs(across) <= TRIM * max(rms, STEP_SIGMA))
        if keep.sum() < least:
            return Run(mu, mv, du, dv, 0.0), keep, rms
        mu, mv, du, dv, rms = axis_of(x, y, keep)
    along = (x[keep] - mu) * du + (y[keep] - mv) * dv
    low, high = along.min(), along.max()
    middle = (low + high) / 2.0
    return Run(mu + middle * du, mv + middle * dv, du, dv, (high - low) / 2.0), keep, rms


@njit(cache=True)
def own_level(seen: Seen, run: Run, u: NDArray, v: NDArray, keep: NDArray) -> tuple[NDArray, NDArray]:
    """w along a run from its own pixels' readings: (w, dw/ds, 0) and the covariance (3, 3)."""
    s, w = np.empty(len(u)), np.empty(len(u))
    n = 0
    for i in range(len(u)):
        if keep[i]:
            s[n] = (u[i] - run.u) * run.du + (v[i] - run.v) * run.dv
            w[n] = w_of(seen.depth[int(v[i]), int(u[i])], seen.camera)
            n += 1
    s, w = s[:n], w[:n]
    good = np.ones(n, dtype=np.bool_)
    a, b, rms = np.median(w), 0.0, 0.0
    for _ in range(3):
        ms, mw = s[good].mean(), w[good].mean()
        b = np.sum((s[good] - ms) * (w[good] - mw)) / max(np.sum((s[good] - ms) ** 2), 1e-9)
        a = mw - b * ms
        e = w - a - b * s
        rms = np.sqrt(np.mean(e[good] ** 2))
        good = np.abs(e) <= TRIM * max(rms, 1e-12)
    covariance = np.zeros((3, 3))
    covariance[0, 0] = 3.0 * rms * rms / n
    covariance[1, 1] = 3.0 * rms * rms / (n * run.half * run.half / 3.0)
    return np.array([a, b, 0.0]), covariance


@njit(cache=True)
def rough_plane(seen: Seen, run: Run, u: NDArray, v: NDArray, keep: NDArray, level: NDArray, step: float) -> tuple[int, NDArray]:
    """A plane beside a run too narrow for a fit: through its own readings, with the windows' median slope `step` px beside it."""
    slopes = np.empty((2, len(u)))
    n = 0
    for i in range(len(u)):
        x, y = int(np.rint(u[i] - step * run.dv)), int(np.rint(v[i] + step * run.du))
        if not keep[i] or x < 0 or y < 0 or x >= seen.depth.shape[1] or y >= seen.depth.shape[0] or np.isnan(seen.slope[y, x, 0]):
            continue
        d = seen.depth[y, x]
        scale = 1.0 if seen.camera[0] > 0.5 else -1.0 / (d * d)
        slopes[0, n], slopes[1, n] = scale * seen.slope[y, x, 0], scale * seen.slope[y, x, 1]
        n += 1
    plane = level.copy()
    if n > 0:
        plane[2] = np.median(slopes[1, :n]) * run.du - np.median(slopes[0, :n]) * run.dv
    return n, plane


@njit(cache=True)
def pixel_variances(run: Run, rms: float, pixels: int, systematic: float, quantum: float) -> tuple[float, float]:
    """Variances of c at the middle [px²] and of its slope along the run, of a line through pixels that are `rms` off it.

    Rounding to pixels is no noise along a run that keeps to one row of them: it only averages out over the rows crossed.
    """
    rows = 2.0 * run.half * min(abs(run.du), abs(run.dv))
    rounding = quantum / max(1.0, rows)
    each = rounding * rounding + 1.5 * rms * rms / pixels  # neighbouring pixels err somewhat alike
    return each + systematic * systematic, 3.0 * each / (run.half * run.half)
