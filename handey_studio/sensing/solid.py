"""What a depth map makes solid: space that no reading vouches for.

Below a reading everything is solid. A hole, where nothing was read, is solid up to the lowest light that passed over it on its
way to a reading elsewhere (the shadow's own slope), and never above the hole's rim. Readings that a located part explains leave
the map with it, and only those; what it stood on stays solid up to the part's underside. A lone reading that stands out of level ground
no farther than readings err is the ground's own: two that agree are a thing. With them goes the sliver of its own shadow
that is no wider than fingers need to close on it: they close by force and tell their width, so they feel what nobody saw there.
At the rim of a part that leans, and in that sliver, what is under it is no higher than what was read beside it: fingers that close on
its sides reach below them.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import ConvexHull

from handey_studio.geometry import HeightField
from handey_studio.geometry.transforms import apply, inverse, transform
from handey_studio.sensing.depth_map import SKY_M, DepthMap
from handey_studio.world import Part, PlacedPart

EXPLAINED_SIGMAS = 4.0  # a reading this many standard deviations from a part's surface is still the part's
SLIVER_M = 0.006  # what fingers need to close on a part: beside it to open, and under its rim to go along a side that leans
BESIDE_M = 0.012  # within which readings tell of a part's rim
AROUND = 2  # cells to each side that must be level around a lone reading


def solid_columns(depth_map: DepthMap) -> HeightField:
    """The columns that are solid before any part is explained."""
    elevation = _without_lone_readings(depth_map)
    unread = np.where(depth_map.passed < SKY_M, depth_map.passed, np.inf)
    top = np.where(np.isnan(elevation), np.minimum(_rim(elevation), unread), elevation)
    return HeightField(top, depth_map.cell, depth_map.T_world_range)


def without_parts(depth_map: DepthMap, columns: HeightField, placed: tuple[PlacedPart, ...]) -> HeightField:
    """`columns` after the readings that the placed parts explain have left the map."""
    top = columns.top.copy()
    for part in placed:
        rows, cols = _around(depth_map, part)
        own, underside = _explained(_cut(depth_map, rows, cols), part)
        top[rows, cols][own] = np.minimum(top[rows, cols][own], underside[own])
    return HeightField(top, columns.cell, columns.T_world_range)


def explained_tolerance(depth_map: DepthMap) -> float:
    """How far [m] from a part's surface a reading may lie and still be the part's: noise and outline error together."""
    return EXPLAINED_SIGMAS * depth_map.noise + depth_map.outline_error


def _without_lone_readings(depth_map: DepthMap) -> NDArray:
    """The elevations (ny, nx) [m] with each lone reading as low as the highest cell beside it: the 24 around it were read and are level,
    and it stands out of them farther than noise explains, but no farther than a surface's readings err."""
    elevation, likely = np.array(depth_map.elevation), EXPLAINED_SIGMAS * depth_map.noise
    _lower_lone(depth_map.elevation, elevation, likely, likely + explained_tolerance(depth_map))
    return elevation


@njit(cache=True)
def _lower_lone(read: NDArray, lowered: NDArray, likely: float, most: float) -> None:
    """Lower the lone readings among `read` (ny, nx): more than `likely` [m] and at most `most` above the middle of those around them, which
    are within `likely` of it themselves."""
    for j in range(AROUND, read.shape[0] - AROUND):
        for i in range(AROUND, read.shape[1] - AROUND):
            around = read[j - AROUND : j + AROUND + 1, i - AROUND : i + AROUND + 1]
            if not read[j, i] - read[j, i - 1] > 0.0 or not read[j, i] - read[j, i + 1] > 0.0:
                continue
            middle = (around.sum() - read[j, i]) / (around.size - 1)
            if not (likely < read[j, i] - middle <= most):
                continue
            level, beside = True, -np.inf
            for a in range(around.shape[0]):
                for b in range(around.shape[1]):
                    if a != AROUND or b != AROUND:
                        level = level and abs(around[a, b] - middle) <= likely
                        beside = max(beside, around[a, b]) if max(abs(a - AROUND), abs(b - AROUND)) == 1 else beside
            if level:
                lowered[j, i] = beside


def _rim(elevation: NDArray) -> NDArray:
    """For every hole cell the greatest elevation around its hole; where a hole has no rim at all, infinity."""
    found: Any = ndimage.label(np.isnan(elevation), structure=np.ones((3, 3)))
    labels, count = found
    around = ndimage.maximum_filter(np.where(np.isnan(elevation), -np.inf, elevation), size=3)
    rims = np.atleast_1d(ndimage.maximum(around, labels, index=np.arange(1, count + 1))) if count else np.empty(0)
    return np.concatenate([[0.0], np.where(np.isfinite(rims), rims, np.inf)])[labels]


@lru_cache(maxsize=32)
def _half_spaces(part: Part) -> tuple[NDArray, ...]:
    """For each convex piece its planes (m, 4): normal · x + offset ≤ 0 inside."""
    return tuple(np.unique(np.round(ConvexHull(piece).equations, 12), axis=0) for piece in part.pieces)


def _around(depth_map: DepthMap, placed: PlacedPart) -> tuple[slice, slice]:
    """Rows and columns of the map, from and to, that hold a part and what is beside it."""
    corners = apply(inverse(depth_map.T_world_range), placed.corners_world)[:, :2] / depth_map.cell
    wide = (max(explained_tolerance(depth_map), SLIVER_M) + BESIDE_M) / depth_map.cell + 2.0
    low, high = np.floor(corners.min(axis=0) - wide).astype(int), np.ceil(corners.max(axis=0) + wide).astype(int)
    ny, nx = depth_map.elevation.shape
    (i0, j0), (i1, j1) = np.clip(low, 0, (nx, ny)), np.clip(high, 0, (nx, ny))
    return slice(j0, j1), slice(i0, i1)


def _cut(depth_map: DepthMap, rows: slice, cols: slice) -> DepthMap:
    """A piece of the map, as a map."""
    T_range_piece = transform(None, (cols.start * depth_map.cell, rows.start * depth_map.cell, 0.0))
    T_world_piece = depth_map.T_world_range @ T_range_piece
    return replace(depth_map, elevation=depth_map.elevation[rows, cols], passed=depth_map.passed[rows, cols], T_world_range=T_world_piece)


def _explained(depth_map: DepthMap, placed: PlacedPart) -> tuple[NDArray, NDArray]:
    """Which cells the part explains (ny, nx), and its underside [m] there in the range frame."""
    tolerance = explained_tolerance(depth_map)
    T_range_part = inverse(depth_map.T_world_range) @ placed.T_world_part
    footprint, underside = _underside(depth_map, apply(T_range_part, placed.part.solid.vertices), placed.part.solid.triangles)
    if not footprint.any():
        return footprint, underside
    reach = int(np.ceil(max(tolerance, SLIVER_M) / depth_map.cell))
    near = ndimage.binary_dilation(footprint, ndimage.generate_binary_structure(2, 2), iterations=reach + 1)
    nearest: Any = ndimage.distance_transform_edt(~footprint, return_distances=False, return_indices=True)
    underside = underside[nearest[0], nearest[1]]
    j, i = np.nonzero(near)
    cells = np.c_[(i + 0.5) * depth_map.cell, (j + 0.5) * depth_map.cell]
    own = np.zeros_like(footprint)
    own[j, i] = np.isnan(depth_map.elevation[j, i])
    seen = ~own[j, i]
    points = np.c_[cells[seen], depth_map.elevation[j[seen], i[seen]]]
    own[j[seen], i[seen]] = _outside_by(placed.part, apply(inverse(T_range_part), points)) <= tolerance
    gap: Any = ndimage.distance_transform_edt(~footprint)
    top = float(apply(T_range_part, placed.part.solid.vertices)[:, 2].max())
    sliver = np.where(depth_map.passed <= top + tolerance, SLIVER_M, tolerance)  # light that passed above the part was not its shadow's
    own &= ~(np.isnan(depth_map.elevation) & (gap * depth_map.cell > np.maximum(sliver, tolerance)))
    return own, np.minimum(underside, _beside(depth_map, own, footprint))


def _beside(depth_map: DepthMap, own: NDArray, footprint: NDArray) -> NDArray:
    """What was read beside the part (ny, nx) [m] where its rim and its sliver are; infinity elsewhere, or if nothing was read near by."""
    seen = ~own & ~np.isnan(depth_map.elevation)
    if not seen.any():
        return np.full(seen.shape, np.inf)
    found: Any = ndimage.distance_transform_edt(~seen, return_indices=True)
    distance, nearest = found
    inside: Any = ndimage.distance_transform_edt(footprint)
    near = (inside * depth_map.cell <= SLIVER_M) & (distance * depth_map.cell <= BESIDE_M)
    return np.where(near, depth_map.elevation[nearest[0], nearest[1]], np.inf)


def _outside_by(part: Part, points_part: NDArray) -> NDArray:
    """How far [m] points (n, 3) lie outside the part, by its pieces' planes; negative inside."""
    distances = [(points_part @ planes[:, :3].T + planes[:, 3]).max(axis=1) for planes in _half_spaces(part)]
    return np.min(distances, axis=0)


def _underside(depth_map: DepthMap, corners_range: NDArray, triangles: NDArray) -> tuple[NDArray, NDArray]:
    """Cells whose centre lies under the solid (ny, nx), and the solid's lowest z [m] there, infinity elsewhere."""
    lowest = np.full(depth_map.elevation.shape, np.inf)
    _lower_by_triangles(lowest, depth_map.cell, np.ascontiguousarray(corners_range[triangles]))
    return np.isfinite(lowest), lowest


@njit(cache=True)
def _lower_by_triangles(lowest: NDArray, cell: float, triangles: NDArray) -> None:
    """Lower each cell to the height of the triangles (k, 3, 3) above or below its centre."""
    ny, nx = lowest.shape
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(area) < 1e-14:
            continue
        i0 = max(0, int(np.floor(min(a[0], b[0], c[0]) / cell)))
        i1 = min(nx - 1, int(np.floor(max(a[0], b[0], c[0]) / cell)))
        j0 = max(0, int(np.floor(min(a[1], b[1], c[1]) / cell)))
        j1 = min(ny - 1, int(np.floor(max(a[1], b[1], c[1]) / cell)))
        for j in range(j0, j1 + 1):
            for i in range(i0, i1 + 1):
                x, y = (i + 0.5) * cell, (j + 0.5) * cell
                v = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
                w = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
                if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
                    z = a[2] + v * (b[2] - a[2]) + w * (c[2] - a[2])
                    if z < lowest[j, i]:
                        lowest[j, i] = z
