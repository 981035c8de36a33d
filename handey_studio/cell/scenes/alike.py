"""Which ways of standing look like another one from straight above: no range finder over the table can tell them apart."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse
from handey_studio.grasping import stable_placements
from handey_studio.world import Part

STEP_M = 0.001  # of the grid that heights are compared on
ALIKE_M = 0.0005  # mean difference of height over what either covers: a range finder's noise
SAME = 1e-3  # poses whose matrices agree to this are one


@lru_cache(maxsize=64)
def seen_alike(part: Part) -> tuple[bool, ...]:
    """For each of the part's stable placements, whether one of them, turned by quarters, has the same heights seen from above.

    What looks the same because it is the same, by the part's symmetries, does not count. An L that stands on its leg's end is an
    example: which way its other leg points shows only from below.
    """
    placements, _ = stable_placements(part)
    poses = [from_xyz_rpy((0, 0, 0), (0, 0, quarter * np.pi / 2)) @ placed.T_plane_part for placed in placements for quarter in range(4)]
    heights = [_heights(part, T) for T in poses]
    return tuple(
        any(_alike(heights[4 * k], other) for T, other in zip(poses, heights, strict=True) if not _same(part, poses[4 * k], T))
        for k in range(len(placements))
    )


def _same(part: Part, T: NDArray, other: NDArray) -> bool:
    """Whether two poses differ by a symmetry of the part and a shift along the plane."""
    between = inverse(T)[:3, :3] @ other[:3, :3]
    return bool((np.abs(part.symmetries[:, :3, :3] - between).max(axis=(1, 2)) < SAME).any())


def _alike(heights: NDArray, other: NDArray) -> bool:
    if heights.shape != other.shape:
        return False
    covered = (heights > 0) | (other > 0)
    return float(np.abs(heights - other)[covered].mean()) < ALIKE_M


def _heights(part: Part, T_plane_part: NDArray) -> NDArray:
    """The highest point (ny, nx) [m] over each spot of the box around the part, 0 where there is nothing."""
    low, high = (bound(apply(T_plane_part, part.solid.vertices), axis=0) for bound in (np.min, np.max))
    counts = np.rint((high - low)[:2] / STEP_M).astype(int)
    x, y = (low[k] + (np.arange(counts[k]) + 0.5) * (high - low)[k] / counts[k] for k in (0, 1))
    spots = np.stack(np.meshgrid(x, y), axis=-1)
    return np.max([_top(apply(T_plane_part, piece), spots) for piece in part.pieces], axis=0)


def _top(corners: NDArray, spots: NDArray) -> NDArray:
    """The top (ny, nx) of a convex piece over spots (ny, nx, 2), 0 beside it."""
    planes = np.unique(np.round(ConvexHull(corners).equations, 9), axis=0)
    level = spots @ planes[:, :2].T + planes[:, 3]
    up, down = planes[:, 2] > 1e-6, planes[:, 2] < -1e-6
    top = (-level[..., up] / planes[up, 2]).min(axis=-1)
    bottom = (-level[..., down] / planes[down, 2]).max(axis=-1)
    beside = (level[..., ~up & ~down] > 0).any(axis=-1)
    return np.where((top < bottom) | beside, 0.0, top)
