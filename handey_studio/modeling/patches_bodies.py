"""Which patches belong to one body: those that meet in convex edges, and others where nothing tells two bodies from one."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from handey_studio.modeling.patches import Crease
from handey_studio.sensing.depth_view import DepthView

GAP_PX = 5  # readings of two patches so near in a row or column may be beside their crease
NEAR_SIGMAS, NEAR_PX = 6.0, 3.0  # and so near in space, in deviations and pixels' sizes
LEAST_READINGS = 5
LONG_CREASE = 8.0  # readings beside a crease by the root of the smaller patch's: patches of two bodies touch more shortly


def creases_of(view: DepthView, points: NDArray, labels: NDArray, planes: NDArray, sigma: NDArray) -> tuple[Crease, ...]:
    """Where patches (labels from 0 on, world planes (n, 4)) meet; `points` (H, W, 3) [m] of the world."""
    points = points.reshape(-1, 3)
    with np.errstate(divide="ignore"):
        reach = (NEAR_SIGMAS * sigma + NEAR_PX / np.asarray(view.projection.pixels_per_metre(view.depth))).ravel()
    count, number = len(planes), np.arange(labels.size).reshape(labels.shape)
    beside = np.zeros((count, count), dtype=int)
    for step in range(1, GAP_PX + 1):
        for one, two in ((np.s_[:, step:], np.s_[:, :-step]), (np.s_[step:], np.s_[:-step])):
            differ = (labels[one] != labels[two]) & (labels[one] >= 0) & (labels[two] >= 0)
            i, j = number[one][differ], number[two][differ]
            met = np.linalg.norm(points[i] - points[j], axis=1) < reach[i] * (1.0 + 0.3 * (step - 1))
            np.add.at(beside, (labels.ravel()[i[met]], labels.ravel()[j[met]]), 1)
    total = beside + beside.T
    middles = np.array([points[labels.ravel() == k].mean(axis=0) for k in range(count)])
    return tuple(
        Crease(a, b, _is_convex(planes, middles, a, b), int(total[a, b]))
        for a in range(count)
        for b in range(a + 1, count)
        if total[a, b] >= LEAST_READINGS
    )


def _is_convex(planes: NDArray, middles: NDArray, a: int, b: int) -> bool:
    """Whether each patch lies behind the other's plane."""
    behind = planes[a, 3] - middles[b] @ planes[a, :3] + planes[b, 3] - middles[a] @ planes[b, :3]
    return bool(behind > 0)


def bodies_of(labels: NDArray, creases: tuple[Crease, ...], count: int) -> tuple[tuple[int, ...], ...]:
    """Patch numbers of each body, that with most readings first."""
    readings = np.bincount(labels[labels >= 0], minlength=count)
    joined = [(c.a, c.b) for c in creases if c.convex and c.readings > LONG_CREASE * np.sqrt(min(readings[c.a], readings[c.b]))]
    rows, columns = np.array(joined, dtype=int).reshape(-1, 2).T
    _, body = connected_components(coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count)), directed=False)
    members = [tuple(int(k) for k in np.nonzero(body == number)[0]) for number in np.unique(body)]
    return tuple(sorted(members, key=lambda group: -int(readings[list(group)].sum())))
