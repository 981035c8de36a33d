"""Planes of laser light: turning about an axis, moved with the rig, and the best one through measured points.

A plane is four numbers (nx, ny, nz, d): the points p with n·p = d, in metres, n of length 1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from handey_studio.base import BadInput

OUTLIER_SIGMAS = 3.5
ROUNDS = 8
LEAST_TOLERANCE_M = 2e-5  # points this near a plane are never outliers: exact data has no spread to measure by


def plane_through(normal: ArrayLike, point: ArrayLike) -> NDArray:
    """The plane (4,) with a normal (3,) of any length through a point (3,)."""
    n = np.asarray(normal, dtype=float)
    length = np.linalg.norm(n)
    if not np.isfinite(length) or length < 1e-9:
        raise BadInput(f"a laser plane's normal is {n.tolist()}; it must be three finite numbers, not all zero.")
    return np.array([*(n / length), float(n @ np.asarray(point, dtype=float)) / length])


def turning_planes(point: ArrayLike, axis: ArrayLike, normal: ArrayLike, angles: ArrayLike) -> NDArray:
    """Planes (n, 4) through a point (3,) whose normal (3,) at angle 0 turns about an axis (3,) by `angles` (n,) [rad]."""
    axis = np.asarray(axis, dtype=float)
    turns = np.asarray(angles, dtype=float)[:, None] * (axis / np.linalg.norm(axis))
    normals = Rotation.from_rotvec(turns).apply(plane_through(normal, point)[:3])
    return np.concatenate([normals, (normals @ np.asarray(point, dtype=float))[:, None]], axis=1)


def moved_planes(T_to_from: NDArray, planes: NDArray) -> NDArray:
    """Planes (n, 4) of one frame in another, by a transform (4, 4) or one for each plane (n, 4, 4)."""
    normals = np.einsum("...ij,...j->...i", T_to_from[..., :3, :3], planes[..., :3])
    offsets = planes[..., 3] + np.einsum("...i,...i->...", normals, T_to_from[..., :3, 3])
    return np.concatenate([normals, offsets[..., None]], axis=-1)


def distances(plane: NDArray, points: NDArray) -> NDArray:
    """Signed distances (n,) [m] of points (n, 3) from a plane (4,)."""
    return points @ plane[:3] - plane[3]


@dataclass(frozen=True)
class PlaneFit:
    """The best plane (4,) through points: which points (n,) it kept, and how they lie in it.

    `rms` [m] is the kept points' distance from the plane; `extents` (2,) [m] their standard deviations along and across
    their main direction within it. With an extent across that is no more than the rms, the points are a line, and the plane
    may turn about it.
    """

    plane: NDArray
    kept: NDArray
    rms: float
    extents: NDArray


def fit_plane(points: NDArray) -> PlaneFit:
    """The least-squares plane through points (n, 3) [m], n ≥ 3, without outliers (by their median distance, in rounds)."""
    kept = np.ones(len(points), dtype=bool)
    plane, extents = _least_squares(points)
    for _ in range(ROUNDS):
        off = np.abs(distances(plane, points))
        now = off <= max(LEAST_TOLERANCE_M, OUTLIER_SIGMAS * 1.4826 * float(np.median(off)))
        plane, extents = _least_squares(points[now])
        if (now == kept).all():
            break
        kept = now
    rms = float(np.sqrt(np.mean(distances(plane, points[kept]) ** 2)))
    return PlaneFit(plane, kept, rms, extents)


def _least_squares(points: NDArray) -> tuple[NDArray, NDArray]:
    centre = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - centre, full_matrices=False)
    return plane_through(axes[2], centre), spread[:2] / np.sqrt(len(points))
