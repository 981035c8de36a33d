"""The forbidden angles of a rectangle that turns about a point of a plane: exact, by closed forms, compiled.

While the hand turns about its grasp point in the grasp plane (Handey 1987 §5.1, Figure 7), each of its boxes stays in one slab parallel to
the plane. What a convex obstacle has in that slab, seen along the closing direction, is a convex polygon, and the box meets the obstacle at
just those angles at which the box's rectangle meets the polygon. At distance r of the point, the rectangle covers the polar angles within
`inner(r)` to `outer(r)` of the direction back along the fingers. So a stretch of a polygon's side is met while the hand's angle lies within
`outer(r)` of the angle under which the point sees it; the first and the last such angle belong to the stretch's ends or to the
rectangle's corners.

A rectangle is (w, low, high) [m]: half its width across the fingers, and from where to where it reaches back from the point. Angles [rad]
are measured from the plane's y towards its z.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

MOST_RANGES = 64  # of one body; with more, the nearest two become one
WHOLE_TURN = 2.0 * np.pi
TOUCHING_RAD = 1e-9  # ranges nearer than this are one: their ends are rounded


@njit(cache=True)
def _outer(r: float, w: float, low: float) -> float:
    """How far off the direction back the rectangle reaches at distance r: to its near side, up to its corners, then to its flanks."""
    if r * r <= (w * w + low * low) * (1.0 + 1e-12):
        return np.arccos(min(max(low / max(r, 1e-300), -1.0), 1.0))
    return np.arcsin(min(w / r, 1.0))


@njit(cache=True)
def _seen_at(base: float, h: float, r: float, side: float) -> float:
    """Polar angle of the point at distance r on a line in direction `base` that passes the origin at signed distance h."""
    return base + np.arctan2(h, side * np.sqrt(max(r * r - h * h, 0.0)))


@njit(cache=True)
def _half_line(base: float, h: float, near: float, far: float, side: float, box: tuple[float, float, float], out: NDArray, n: int) -> int:
    """Adds to out the ranges of a stretch on one side of its line's foot, from distance `near` to `far` of the origin."""
    w, low, high = box
    if near <= -low:
        out[n, 0], out[n, 1] = 0.0, WHOLE_TURN
        return n + 1
    corner, reach = np.sqrt(w * w + low * low), np.sqrt(w * w + high * high)
    start, end = max(near, low), min(far, reach)
    if start > end:
        return n
    first, last = np.inf, -np.inf
    if start <= high:
        stop = min(end, high)
        for r in (start, stop, min(max(corner, start), stop)):
            seen, most = _seen_at(base, h, r, side) - np.pi, _outer(r, w, low)
            first, last = min(first, seen - most), max(last, seen + most)
        out[n, 0], out[n, 1] = first, last
        n += 1
    if end > high:
        start = max(start, high)
        firsts, lasts = (np.inf, np.inf), (-np.inf, -np.inf)
        for r in (start, end, min(max(corner, start), end)):
            seen, most, least = _seen_at(base, h, r, side) - np.pi, _outer(r, w, low), np.arccos(min(high / r, 1.0))
            firsts = (min(firsts[0], seen - most), min(firsts[1], seen + least))
            lasts = (max(lasts[0], seen - least), max(lasts[1], seen + most))
        for k in range(2):
            out[n, 0], out[n, 1] = firsts[k], lasts[k]
            n += 1
    return n


@njit(cache=True)
def stretch_ranges(ay: float, az: float, by: float, bz: float, box: tuple[float, float, float], out: NDArray) -> int:
    """Fills out (6, 2) with the ranges of angles at which a rectangle meets the stretch from a to b; how many there are."""
    y, z = by - ay, bz - az
    length = np.sqrt(y * y + z * z)
    if length > 1e-12:
        y, z = y / length, z / length
    else:
        y, z = 1.0, 0.0
    base, h = np.arctan2(z, y), y * az - z * ay
    s, t = ay * y + az * z, by * y + bz * z
    r, q = np.sqrt(ay * ay + az * az), np.sqrt(by * by + bz * bz)
    if s < 0.0 < t:
        n = _half_line(base, h, abs(h), r, -1.0, box, out, 0)
        return _half_line(base, h, abs(h), q, 1.0, box, out, n)
    return _half_line(base, h, min(r, q), max(r, q), 1.0 if s + t >= 0.0 else -1.0, box, out, 0)


@njit(cache=True)
def insert(first: float, last: float, window: tuple[float, float], ranges: NDArray, counts: NDArray, body: int) -> None:
    """Adds a range of angles to those of a body, `ranges` (b, MOST_RANGES, 2) of which `counts` (b,) hold; clipped to a window of less than
    a whole turn, and made one with those that it overlaps."""
    turn = WHOLE_TURN * np.ceil((window[0] - last) / WHOLE_TURN)
    while first + turn <= window[1]:
        low, high = max(first + turn, window[0]), min(last + turn, window[1])
        k = 0
        while k < counts[body]:
            if ranges[body, k, 0] <= high + TOUCHING_RAD and low <= ranges[body, k, 1] + TOUCHING_RAD:
                low, high = min(low, ranges[body, k, 0]), max(high, ranges[body, k, 1])
                counts[body] -= 1
                ranges[body, k, 0], ranges[body, k, 1] = ranges[body, counts[body], 0], ranges[body, counts[body], 1]
                k = 0
            else:
                k += 1
        if counts[body] == MOST_RANGES:
            join_nearest(ranges[body], counts, body)
        ranges[body, counts[body], 0], ranges[body, counts[body], 1] = low, high
        counts[body] += 1
        turn += WHOLE_TURN


@njit(cache=True)
def _next_start(angle: float, ranges: NDArray, count: int) -> int:
    """Which range begins first after an angle; -1 for none."""
    found = -1
    for k in range(count):
        if ranges[k, 0] > angle and (found < 0 or ranges[k, 0] < ranges[found, 0]):
            found = k
    return found


@njit(cache=True)
def join_nearest(ranges: NDArray, counts: NDArray, body: int) -> None:
    """Makes one of the two ranges with the least free room between them: more is forbidden, never less."""
    one, other, least = -1, -1, np.inf
    for k in range(counts[body]):
        after = _next_start(ranges[k, 1], ranges, counts[body])
        if after >= 0 and ranges[after, 0] - ranges[k, 1] < least:
            one, other, least = k, after, ranges[after, 0] - ranges[k, 1]
    counts[body] -= 1
    ranges[one, 1] = ranges[other, 1]
    ranges[other, 0], ranges[other, 1] = ranges[counts[body], 0], ranges[counts[body], 1]


@njit(cache=True)
def polygon_ranges(
    corners: NDArray, box: tuple[float, float, float], window: tuple[float, float], ranges: NDArray, counts: NDArray, body: int
) -> None:
    """Adds the angles at which a rectangle meets a convex polygon of corners (n, 2) [m]: it meets their sides, or is inside."""
    found = np.empty((6, 2))
    n = len(corners)
    for k in range(n):
        j = (k + 1) % n
        for f in range(stretch_ranges(corners[k, 0], corners[k, 1], corners[j, 0], corners[j, 1], box, found)):
            insert(found[f, 0], found[f, 1], window, ranges, counts, body)
    middle, low = (box[1] + box[2]) / 2.0, window[0]
    while n > 2 and low < window[1]:
        for k in range(counts[body]):
            if ranges[body, k, 0] <= low <= ranges[body, k, 1]:
                low = ranges[body, k, 1] + 0.5 * TOUCHING_RAD
                break
        after = _next_start(low, ranges[body], counts[body])
        high = ranges[body, after, 0] if after >= 0 else window[1]
        between = (low + high) / 2.0
        if low < high and _inside(corners, -middle * np.cos(between), -middle * np.sin(between)):
            insert(low, high, window, ranges, counts, body)
        low = high


@njit(cache=True)
def _inside(corners: NDArray, y: float, z: float) -> bool:
    """Whether a point lies in a convex polygon whose corners run counter-clockwise."""
    n = len(corners)
    for k in range(n):
        j = (k + 1) % n
        u, v = corners[j, 0] - corners[k, 0], corners[j, 1] - corners[k, 1]
        if u * (z - corners[k, 1]) - v * (y - corners[k, 0]) < 0.0:
            return False
    return True
