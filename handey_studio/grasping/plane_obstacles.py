"""What is in the way of a hand that turns in the grasp plane: obstacles clipped to the hand's slabs, seen along the closing direction.

Everything is told in the grasp plane's frame, which is fixed to the part. So the obstacles of the pickup and those of the putdown, carried
back by the inverse of the part's motion (Handey 1987 §5.1, Figure 8), are the same kind of thing.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.grasping.forbidden_angles import polygon_ranges
from handey_studio.world import FINGERS, Hand
from handey_studio.world.collision_bodies import Obstacles

CLOSING_MARGIN_M = 1e-4  # fingers that close on a part keep this from all else: what stands beside the part is that near


class Volumes(NamedTuple):
    """The hand's boxes as they turn in the plane: `slabs` (v, 2) [m] from where to where along the closing direction, `boxes` (v, 3) [m]
    half the width, and from where to where back from the fingertips."""

    slabs: NDArray
    boxes: NDArray


def hand_volumes(hand: Hand, width: float, opening: float, margin: float, skin: float = 0.0) -> Volumes:
    """The volumes of a hand that closes from `opening` to `width` [m], larger by `margin` [m] all around.

    What its fingers sweep while they close comes last, larger by CLOSING_MARGIN_M; it ends `skin` [m] before the part's surface, so that
    they may touch it.
    """
    slabs, boxes = [], []
    for lower, upper in hand.boxes(opening).values():
        slabs.append((lower[0] - margin, upper[0] + margin))
        boxes.append(_rectangle(lower, upper, margin))
    for name, (lower, upper) in hand.boxes(opening).items():
        if name in FINGERS:
            slabs.append((lower[0], -width / 2.0 - skin) if upper[0] <= 0 else (width / 2.0 + skin, upper[0]))
            boxes.append(_rectangle(lower, upper, CLOSING_MARGIN_M))
    return Volumes(np.array(slabs), np.array(boxes))


def _rectangle(lower: NDArray, upper: NDArray, margin: float) -> tuple[float, float, float]:
    return max(-lower[1], upper[1]) + margin, -upper[2] - margin, -lower[2] + margin


@njit(cache=True)
def add_solids(
    solids: Obstacles, skipped: int, T_world_plane: NDArray, volumes: Volumes, window: tuple[float, float], ranges: NDArray, counts: NDArray
) -> None:
    """Adds the angles that convex bodies forbid, to the ranges of their names; the body called `skipped` is passed over.

    `T_world_plane` (4, 4) has its origin at the grasp point.
    """
    far = 0.0
    for v in range(len(volumes.slabs)):
        reach = max(-volumes.slabs[v, 0], volumes.slabs[v, 1]) ** 2 + volumes.boxes[v, 0] ** 2 + volumes.boxes[v, 2] ** 2
        far = max(far, np.sqrt(reach))
    for k in range(len(solids.name)):
        first, last = solids.first[k], solids.first[k + 1]
        if solids.name[k] == skipped or _distance(solids.corners, first, last, T_world_plane) > far:
            continue
        corners = _seen(T_world_plane, solids.corners, first, last)
        for v in range(len(volumes.slabs)):
            box = (volumes.boxes[v, 0], volumes.boxes[v, 1], volumes.boxes[v, 2])
            if _far(corners, volumes.slabs[v], box):
                continue
            outline = hull(clipped(corners, volumes.slabs[v, 0], volumes.slabs[v, 1]))
            if len(outline):
                polygon_ranges(outline, box, window, ranges, counts, solids.name[k])


@njit(cache=True)
def _distance(corners: NDArray, first: int, last: int, T: NDArray) -> float:
    """Distance [m] from a frame's origin to the box around a body."""
    total = 0.0
    for axis in range(3):
        low, high = np.inf, -np.inf
        for i in range(first, last):
            low, high = min(low, corners[i, axis]), max(high, corners[i, axis])
        total += max(low - T[axis, 3], T[axis, 3] - high, 0.0) ** 2
    return np.sqrt(total)


@njit(cache=True)
def _seen(T: NDArray, corners: NDArray, first: int, last: int) -> NDArray:
    """A body's corners (k, 3) in a frame."""
    out = np.empty((last - first, 3))
    for i in range(len(out)):
        x, y, z = corners[first + i, 0] - T[0, 3], corners[first + i, 1] - T[1, 3], corners[first + i, 2] - T[2, 3]
        for axis in range(3):
            out[i, axis] = T[0, axis] * x + T[1, axis] * y + T[2, axis] * z
    return out


@njit(cache=True)
def _far(corners: NDArray, slab: NDArray, box: tuple[float, float, float]) -> bool:
    """Whether a body's bounding box lies beside the slab or farther from the point than the rectangle reaches."""
    gaps = 0.0
    for axis in range(3):
        low, high = np.inf, -np.inf
        for i in range(len(corners)):
            low, high = min(low, corners[i, axis]), max(high, corners[i, axis])
        if axis == 0:
            if low > slab[1] or high < slab[0]:
                return True
        else:
            gaps += max(low, -high, 0.0) ** 2
    return gaps > box[0] ** 2 + box[2] ** 2


@njit(cache=True)
def clipped(corners: NDArray, low: float, high: float) -> NDArray:
    """Points (n, 2) [m] in y, z whose hull is what a convex body of corners (k, 3) has in the slab low ≤ x ≤ high."""
    k = len(corners)
    out = np.empty((k * k, 2))
    n = 0
    for i in range(k):
        x = corners[i, 0]
        if low <= x <= high:
            out[n, 0], out[n, 1] = corners[i, 1], corners[i, 2]
            n += 1
        for j in range(i):
            for wall in (low, high):
                if (x - wall) * (corners[j, 0] - wall) < 0.0:
                    share = (wall - x) / (corners[j, 0] - x)
                    out[n, 0] = corners[i, 1] + share * (corners[j, 1] - corners[i, 1])
                    out[n, 1] = corners[i, 2] + share * (corners[j, 2] - corners[i, 2])
                    n += 1
    return out[:n]


@njit(cache=True)
def hull(points: NDArray) -> NDArray:
    """Corners (m, 2) of the convex hull of points (n, 2), counter-clockwise; two for points on a line, one for one point.

    Andrew's monotone chain: sorted, the lower side is walked to the right and the upper side back.
    """
    n = len(points)
    order, out = np.arange(n), np.empty((2 * n + 1, 2))
    for i in range(1, n):
        here, k = order[i], i
        while k > 0 and _before(points, here, order[k - 1]):
            order[k] = order[k - 1]
            k -= 1
        order[k] = here
    m = 0
    for way in range(2):
        first = m
        for i in range(n):
            here = order[i] if way == 0 else order[n - 1 - i]
            y, z = points[here, 0], points[here, 1]
            while m >= first + 2 and not _turns_left(out, m, y, z):
                m -= 1
            if m == first or y != out[m - 1, 0] or z != out[m - 1, 1]:
                out[m, 0], out[m, 1] = y, z
                m += 1
        m = max(m - 1, 1) if n else 0  # the last one begins the other side
    return out[:m]


@njit(cache=True)
def _before(points: NDArray, i: int, j: int) -> bool:
    return points[i, 0] < points[j, 0] or (points[i, 0] == points[j, 0] and points[i, 1] < points[j, 1])


@njit(cache=True)
def _turns_left(chain: NDArray, m: int, y: float, z: float) -> bool:
    """Whether the way from the last two of m corners on to a point turns left."""
    u, v = chain[m - 1, 0] - chain[m - 2, 0], chain[m - 1, 1] - chain[m - 2, 1]
    return u * (z - chain[m - 1, 1]) - v * (y - chain[m - 1, 0]) > 0.0
