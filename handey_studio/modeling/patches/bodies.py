"""Which patches belong to one body: those that meet in convex edges, and others where nothing tells two bodies from one."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from handey_studio.modeling.patches.patch import Crease, Patch
from handey_studio.sensing.depth_view import DepthView

GAP_PX = 5  # readings of two patches so near in a row or column may be beside their crease
NEAR_SIGMAS, NEAR_PX = 6.0, 3.0  # and so near in space, in deviations and pixels' sizes
LEAST_READINGS = 5
FULL_SIDE = 0.8  # of a patch's length: a rim along all of it
LONG_CREASE = 6.0  # readings beside a crease by the root of the smaller patch's: patches of two bodies touch more shortly


def creases_of(view: DepthView, points: NDArray, labels: NDArray, planes: NDArray, sigma: NDArray) -> tuple[Crease, ...]:
    """Where patches (labels from 0 on, world planes (n, 4)) meet; `points` (H, W, 3) [m] of the world."""
    points = points.reshape(-1, 3)
    with np.errstate(divide="ignore"):
        reach = (NEAR_SIGMAS * sigma + NEAR_PX / np.asarray(view.projection.pixels_per_metre(view.depth))).ravel()
    count, number = len(planes), np.arange(labels.size).reshape(labels.shape)
    beside, flank = np.zeros((count, count), dtype=int), np.zeros((count, count, 3))
    for step in range(1, GAP_PX + 1):
        for one, two in ((np.s_[:, step:], np.s_[:, :-step]), (np.s_[step:], np.s_[:-step])):
            differ = (labels[one] != labels[two]) & (labels[one] >= 0) & (labels[two] >= 0)
            i, j = number[one][differ], number[two][differ]
            met = np.linalg.norm(points[i] - points[j], axis=1) < reach[i] * (1.0 + 0.3 * (step - 1))
            a, b = labels.ravel()[i[met]], labels.ravel()[j[met]]
            np.add.at(beside, (a, b), 1)
            np.add.at(flank, (a, b), points[i[met]])
            np.add.at(flank, (b, a), points[j[met]])
    total = beside + beside.T
    return tuple(
        Crease(a, b, _is_convex(planes, flank[a, b] / total[a, b], flank[b, a] / total[a, b], a, b), int(total[a, b]))
        for a in range(count)
        for b in range(a + 1, count)
        if total[a, b] >= LEAST_READINGS
    )


def _is_convex(planes: NDArray, beside_a: NDArray, beside_b: NDArray, a: int, b: int) -> bool:
    """Whether the readings (3,) of each patch beside the crease lie behind the other's plane."""
    behind = planes[a, 3] - beside_b @ planes[a, :3] + planes[b, 3] - beside_a @ planes[b, :3]
    return bool(behind > 0)


def bodies_of(patches: Sequence[Patch], creases: Sequence[Crease], slack: float) -> tuple[tuple[int, ...], ...]:
    """Patch numbers of each body, that with most readings first.

    Patches that meet in a convex edge are one body's. A step, down over a rim or up a concave edge, is taken for one body's if both
    faces end at the same places along it, within `slack` [m]: two bodies would hardly stand so flush.
    """
    joined = []
    for crease in creases:
        a, b = patches[crease.a], patches[crease.b]
        long = crease.readings > LONG_CREASE * np.sqrt(min(a.readings, b.readings))
        if long and (crease.convex or _flush(a, b, np.cross(a.normal, b.normal), slack)):
            joined.append((a.number, b.number))
    for upper in patches:
        for start, end, border in zip(upper.rings[0], np.roll(upper.rings[0], -1, axis=0), upper.borders[0], strict=True):
            if border.kind == "rim" and border.other >= 0 and _flush(upper, patches[border.other], end - start, slack, end - start):
                joined.append((upper.number, border.other))
    rows, columns = np.array(joined, dtype=int).reshape(-1, 2).T
    links = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(patches), len(patches)))
    body = connected_components(links, directed=False)[1]
    members = [tuple(int(k) for k in np.nonzero(body == number)[0]) for number in np.unique(body)]
    return tuple(sorted(members, key=lambda group: -sum(patches[k].readings for k in group)))


def _flush(a: Patch, b: Patch, direction: NDArray, slack: float, side: NDArray | None = None) -> bool:
    """Whether two patches begin and end at the same places along a direction; a `side` must be as long as they are."""
    length = float(np.linalg.norm(direction))
    if length < 1e-9:
        return False
    one, other = (patch.rings[0] @ direction / length for patch in (a, b))
    apart = max(abs(one.min() - other.min()), abs(one.max() - other.max()))
    return bool(apart < slack and (side is None or length > FULL_SIDE * np.ptp(one)))
