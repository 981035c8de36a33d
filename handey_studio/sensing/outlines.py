"""How far a depth image's silhouettes may lie off sideways, measured from the image itself.

Depth cameras match patches of a pattern, so at a jump of depth they lose readings or give them to the wrong side, now more, now less:
the outline of a straight edge wanders. A sensor that reads each pixel for itself, or a rendering, keeps it straight to the pixel, but
for readings that it loses by chance: these differ from line to line, where a wandering outline changes little.
The contours of jumps are followed over a few pixels each and held against straight lines; most contours of things are straight for so
long. What also counts is the band without readings beside a jump, in the direction where it is narrowest: shadows make it wide in others.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.sensing.depth_view import Orthographic, Pinhole

WINDOW_PX = 23  # lines over which a contour is followed: edges wander over tens of pixels
BANDS = 24  # of so many lines are looked at, in each of the four directions
MAX_GAP_PX = 25  # wider bands without readings are no mark of the outline
MAX_TURN_PX = 6  # from line to line
MAX_SLANT = 1.2  # px a line; flatter contours are followed in the other direction
MIN_CONTOURS = 6
STRAIGHT_SHARE = 0.4  # this quantile of the contours: a part of them has corners
ROUNDING = 1.0 / 12.0  # px²: what whole pixels alone make of a straight line
BIAS = 4.6  # an outline whose lines wander together by this standard deviation lies off by so many times as much
JUMP_SIGMAS, JUMP_PX = 8.0, 5.0  # a jump is that many times the noise or the pixel
STEEPEST_PX = 3.0  # depth falls by no more pixels' sizes a pixel on a surface that is seen at all
UNKNOWN_PX = 2.0
MOST_M = 0.008


def measured_outline_error(depth: NDArray, projection: Pinhole | Orthographic, noise: float) -> float:
    """How far [m] silhouettes may lie off sideways, at the median depth of a depth image (H, W) [m], NaN where none, with `noise` [m].

    About a pixel's size for a clean rendering; two if the image shows too few jumps to tell.
    """
    depth = np.ascontiguousarray(depth, dtype=float)
    readings = depth[:: max(1, len(depth) // 200)]
    readings = readings[np.isfinite(readings)]
    pixel = float(1.0 / projection.pixels_per_metre(float(np.median(readings)) if len(readings) else 1.0))
    jump = max(JUMP_SIGMAS * noise, JUMP_PX * pixel)
    sideways = np.ascontiguousarray(depth.T)
    contours = [_contours(image, _bands(len(image)), way, jump, STEEPEST_PX * pixel) for image in (depth, sideways) for way in (1, -1)]
    off = np.concatenate([found[:, 0] for found in contours])
    if len(off) < MIN_CONTOURS:
        return min(UNKNOWN_PX * pixel, MOST_M)
    off_px = float(np.quantile(off, STRAIGHT_SHARE))
    lost_px = min(0.5 * (float(np.median(found[:, 1])) - 1.0) for found in contours if len(found))
    return float(np.clip(max(off_px, lost_px) * pixel, pixel, max(pixel, MOST_M)))


def _bands(lines: int) -> NDArray:
    """First lines of the bands that are looked at, evenly spread."""
    step = max(WINDOW_PX, lines // BANDS)
    return np.arange((lines % step) // 2, lines - WINDOW_PX + 1, step)


@njit(cache=True)
def _contours(depth: NDArray, tops: NDArray, way: int, jump: float, per_px: float) -> NDArray:
    """How far off it lies [px] and how wide its jump is [px] (n, 2), of each contour that crosses a band from its first line to its last.

    `way` 1 looks along the lines for jumps to farther readings, −1 against them.
    """
    width = depth.shape[1]
    most = width // 4 + 1
    place = np.empty((WINDOW_PX, most), dtype=np.int64)
    gap = np.empty((WINDOW_PX, most), dtype=np.int64)
    count = np.zeros(WINDOW_PX, dtype=np.int64)
    out = np.empty((len(tops) * most, 2))
    n = 0
    for top in tops:
        for line in range(WINDOW_PX):
            count[line] = _jumps_of(depth[top + line], way, jump, per_px, place[line], gap[line])
        for k in range(count[0]):
            off, lost = _follow(place, gap, count, k)
            if off >= 0.0:
                out[n, 0], out[n, 1] = off, lost
                n += 1
    return out[:n]


@njit(cache=True)
def _jumps_of(line: NDArray, way: int, jump: float, per_px: float, place: NDArray, gap: NDArray) -> int:
    """Where a line's readings jump away (the last near pixel), how many pixels farther the far ones begin, and how many jumps."""
    n, last, start = 0, -1, -1
    width = len(line)
    for step in range(width):
        u = step if way > 0 else width - 1 - step
        if np.isnan(line[u]):
            continue
        if last >= 0:
            apart = abs(u - last)
            falls = apart <= MAX_GAP_PX and line[u] - line[last] > jump + per_px * (apart - 1)
            if falls and start < 0:
                start = last
            elif not falls and start >= 0:
                if n < len(place):
                    place[n], gap[n] = start, abs(last - start)
                    n += 1
                start = -1
        last = u
    return n


@njit(cache=True)
def _follow(place: NDArray, gap: NDArray, count: NDArray, k: int) -> tuple[float, float]:
    """How far off [px] the contour from the first line's k-th jump lies, by how it wanders about a straight line, −1 if it ends; its mean
    gap [px]. What is not alike in neighbouring lines is chance, and lies no farther off than it wanders."""
    n = len(count)
    at, total = place[0, k], 0.0
    places = np.empty(n)
    for line in range(n):
        best, chosen = MAX_TURN_PX + 1, -1
        for i in range(count[line]):
            if abs(place[line, i] - at) < best:
                best, chosen = abs(place[line, i] - at), i
        if chosen < 0:
            return -1.0, 0.0
        at = place[line, chosen]
        places[line] = at
        total += gap[line, chosen]
    t = np.arange(n) - 0.5 * (n - 1)
    slant = (t * places).sum() / (t * t).sum()
    if abs(slant) > MAX_SLANT:
        return -1.0, 0.0
    off = places - places.mean() - slant * t
    variance, steps = (off * off).sum() / (n - 2), off[1:] - off[:-1]
    chance = min(max(0.5 * (steps * steps).mean(), ROUNDING), variance)
    lies_off = BIAS * BIAS * (variance - chance) + max(chance - ROUNDING, 0.0)
    return np.sqrt(lies_off / (1.0 + slant * slant)), total / n
