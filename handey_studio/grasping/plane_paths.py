"""Paths of the hand in the grasp plane: whether a motion is free, and paths made shorter."""

from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.grasping.grasp_plane import Filled, GraspPlane
from handey_studio.grasping.hand_outline import Outline, meets


def shortened(plane: GraspPlane, outline: Outline, path: NDArray, margin: float, spacing: float = 0.002) -> NDArray:
    """The path (k, 3) with its detours cut off where the straight motion keeps the margin [m] as well, resampled so that no corner of the
    hand moves farther than about `spacing` [m] from pose to pose. First and last pose stay."""
    kept, at = [path[0]], 0
    while at < len(path) - 1:
        to = len(path) - 1
        while to > at + 1 and not is_free(plane, outline, path[at], path[to], margin, spacing):
            to = at + max(1, (to - at) * 3 // 4)
        kept.append(path[to])
        at = to
    return resampled(np.array(kept), _lever(outline), spacing)


def is_free(plane: GraspPlane, outline: Outline, one: NDArray, other: NDArray, margin: float = 0.0, spacing: float = 0.002) -> bool:
    """Whether the straight motion between two poses (3,) keeps the margin [m] from filled cells, looked at every `spacing` [m]."""
    one, other = np.array(one, dtype=float), np.array(other, dtype=float)
    moved = np.linalg.norm(other[:2] - one[:2]) + _lever(outline) * abs(other[2] - one[2])
    return bool(_all_free(plane.filled, outline, one, other, max(1, int(np.ceil(moved / spacing))), margin))


def _lever(outline: Outline) -> float:
    """How far [m] from the fingertips a corner of the outline is at most."""
    return float(np.hypot(np.abs(outline.bounds[:, 2:]).max(), np.abs(outline.bounds[:, :2]).max()))


def resampled(path: NDArray, lever: float, spacing: float = 0.002) -> NDArray:
    """Poses (n, 3) along straight motions between those of a path (k, 3)."""
    rows = [path[:1]]
    for a, b in pairwise(path):
        moved = np.linalg.norm(b[:2] - a[:2]) + lever * abs(b[2] - a[2])
        shares = np.linspace(0.0, 1.0, 1 + max(1, int(np.ceil(moved / spacing))))[1:, None]
        rows.append(a + shares * (b - a))
    return np.concatenate(rows)


@njit(cache=True)
def _all_free(filled: Filled, outline: Outline, one: NDArray, other: NDArray, count: int, margin: float) -> bool:
    """Whether `count` + 1 poses in a row from one to the other are free."""
    free = True
    for k in range(count + 1):
        free = free and not meets(filled, outline, one + (other - one) * (k / count), margin)
    return free
