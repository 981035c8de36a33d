"""A conservative distance field of the scene: for any point, a number that the distance to everything solid never falls below.

A convex body's distance from a voxel is at least its gap across any of the body's faces, and gaps across faces of mutually orthogonal
directions add up like the sides of a right-angled triangle: for cuboids and prisms nothing is lost. The depth map's columns are filled
in voxel by voxel and their distances swept along one axis after the other.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from handey_studio.base.compiled import put
from handey_studio.geometry import HeightField
from handey_studio.motion.cores import share
from handey_studio.world import World
from handey_studio.world.collision import CollisionModel, collision_model
from handey_studio.world.collision_bodies import Obstacles, terrain_obstacles

CLIP_M = 0.4  # farther than this nothing is told apart: more than a cell of the configuration space moves anything
AROUND_PART_M = 0.15  # the grid of a part alone; its box tells how far it is from farther off
FINEST_M = 0.01
MOST_VOXELS = 800_000
ROUND_M = 0.1  # grids begin and end at multiples of this, so that worlds that differ in one part share theirs


class Field(NamedTuple):
    """`values[i, j, k]` [m] is a lower bound of the distance between any point of a voxel and what is solid, which is at least `clip` [m]
    inside the grid: voxels `cell` [m] wide, `voxels` to a metre, `low` (3,) the grid's lower corner. The table and the walls of the free
    space `free` (2, 3), which ends where the arm does not get, are planes apart from it.
    """

    low: NDArray
    cell: float
    voxels: float
    values: NDArray
    clip: float
    table_z: float
    free: NDArray


class Grid(NamedTuple):
    """Voxels: lower corner (3,) [m], width [m], counts (3,)."""

    low: tuple[float, ...]
    cell: float
    counts: tuple[int, ...]


@lru_cache(maxsize=32)
def distance_field(world: World, reach: float) -> Field:
    """The field of a world's blocks, parts and depth map as far as the arm with all that it carries may reach [m], kept in this process."""
    model, shoulder = collision_model(world), world.robot.T_world_base[:3, 3]
    far = reach + CLIP_M
    free = np.array([np.maximum(world.free_space[0], shoulder - far), np.minimum(world.free_space[1], shoulder + far)])
    alone = world.terrain is None and not world.blocks
    clip, most = (AROUND_PART_M, 2 * far) if alone else (CLIP_M, CLIP_M)
    grid = _grid(model, max(world.table_z, float(free[0, 2])), free, clip)
    if alone:
        values = np.full(grid.counts, most, np.float32)
    else:
        values = _terrain_distances(world.terrain, world.table_z, float(world.free_space[1, 2]), grid).copy()
    low, solids = np.array(grid.low), model.solids
    for k in range(model.slabs, len(solids.name)):
        corners = solids.corners[solids.first[k] : solids.first[k + 1]]
        planes, groups = faces_by_direction(corners)
        _stamp(values, planes, groups, corners.min(axis=0), corners.max(axis=0), low, grid.cell, most)
    return Field(low, grid.cell, 1.0 / grid.cell, values, clip, float(world.table_z), free)


def _grid(model: CollisionModel, bottom: float, free: NDArray, margin: float) -> Grid:
    """The grid over all bodies but the table and the outside, as far as they are in the space `free` (2, 3) [m], and `margin` around them;
    nothing below `bottom` [m].
    """
    tree = model.terrain.tree
    boxes = np.concatenate([_spans(model.solids)[model.slabs :], np.stack([tree.low[:1], tree.high[:1]], axis=1)])
    boxes = np.stack([np.maximum(boxes[:, 0], [*free[0, :2], bottom]), np.minimum(boxes[:, 1], free[1])], axis=1)
    boxes = boxes[(boxes[:, 1] > boxes[:, 0]).all(axis=1)]
    if not len(boxes):
        return Grid((0.0, 0.0, bottom if np.isfinite(bottom) else 0.0), FINEST_M, (0, 0, 0))
    low = np.floor((boxes[:, 0].min(axis=0) - margin) / ROUND_M) * ROUND_M
    low[2] = max(low[2], bottom)
    high = np.ceil((boxes[:, 1].max(axis=0) + margin) / ROUND_M) * ROUND_M
    cell = max(FINEST_M, float(np.cbrt(np.prod(high - low) / MOST_VOXELS)))
    return Grid(tuple(low.tolist()), cell, tuple(np.ceil((high - low) / cell).astype(int).tolist()))


def _spans(fixed: Obstacles) -> NDArray:
    """Lower and upper corners (k, 2, 3) [m] of fixed bodies."""
    if not len(fixed.name):
        return np.empty((0, 2, 3))
    starts = fixed.first[:-1]
    return np.stack([np.minimum.reduceat(fixed.corners, starts), np.maximum.reduceat(fixed.corners, starts)], axis=1)


def _column_spans(terrain: Obstacles) -> NDArray:
    """Lower and upper corners (k, 2, 3) [m] of the depth map's columns, as their tree has them."""
    leaves = slice(len(terrain.tree.low) // 2, len(terrain.tree.low) // 2 + len(terrain.name))
    return np.stack([terrain.tree.low[leaves], terrain.tree.high[leaves]], axis=1)


def faces_by_direction(corners: NDArray) -> tuple[NDArray, NDArray]:
    """Outward planes (f, 4) of the hull of corners (k, 3), n·x + d ≤ 0 inside, sorted into groups; where each begins and ends (g + 1,).

    Directions of different groups are orthogonal: a cuboid has three, a prism two, most bodies one.
    """
    planes = np.unique(np.round(ConvexHull(corners).equations, 9), axis=0)
    count, group = connected_components(np.abs(planes[:, :3] @ planes[:, :3].T) > 1e-9, directed=False)
    order = np.argsort(group, kind="stable")
    return np.ascontiguousarray(planes[order]), np.searchsorted(group[order], np.arange(count + 1))


@njit(cache=True, fastmath=True)
def _stamp(
    values: NDArray, planes: NDArray, groups: NDArray, lower: NDArray, upper: NDArray, low: NDArray, cell: float, clip: float
) -> None:
    """Lowers the values to the distance from one convex body within `lower` to `upper`."""
    first, last = np.zeros(3, np.int64), np.zeros(3, np.int64)
    for axis in range(3):
        first[axis] = max(int(np.floor((lower[axis] - clip - low[axis]) / cell)), 0)
        last[axis] = min(int(np.floor((upper[axis] + clip - low[axis]) / cell)), values.shape[axis] - 1) + 1
    n = last[2] - first[2]
    if n <= 0:
        return
    heights = np.empty(n, np.float32)
    for k in range(n):
        heights[k] = low[2] + (first[2] + k + 0.5) * cell
    squares, gap = np.empty(n, np.float32), np.empty(n, np.float32)
    nothing, far = np.float32(0.0), np.float32(clip * clip)
    for i in range(first[0], last[0]):
        x = low[0] + (i + 0.5) * cell
        for j in range(first[1], last[1]):
            y = low[1] + (j + 0.5) * cell
            squares[:] = nothing
            for g in range(len(groups) - 1):
                gap[:] = nothing
                for f in range(groups[g], groups[g + 1]):
                    a, b, c, d = planes[f]
                    here = np.float32(a * x + b * y + d - 0.5 * cell * (abs(a) + abs(b) + abs(c)))
                    slope = np.float32(c)
                    for k in range(n):
                        gap[k] = max(gap[k], here + slope * heights[k])
                for k in range(n):
                    squares[k] += gap[k] * gap[k]
            row = values[i, j, first[2] : last[2]]
            for k in range(n):
                if squares[k] < far:
                    row[k] = min(row[k], np.sqrt(squares[k]))


@lru_cache(maxsize=4)
def _terrain_distances(terrain: HeightField | None, table_z: float, ceiling: float, grid: Grid) -> NDArray:
    """Distances (nx, ny, nz) float32 [m] from the depth map's columns, kept from world to world."""
    values = np.full(grid.counts, CLIP_M, np.float32)
    if terrain is None:
        return values
    tops = np.zeros(grid.counts[:2], np.int64)
    _fill_columns(tops, grid.counts[2], _column_spans(terrain_obstacles(terrain, table_z, ceiling)), np.array(grid.low), grid.cell)
    near = min(grid.counts[2], int(tops.max(initial=0)) + 1 + int(np.ceil(CLIP_M / grid.cell)))
    values[:, :, :near] = column_distances(tops, near, grid.cell, CLIP_M)
    return values


@njit(cache=True)
def _fill_columns(tops: NDArray, nz: int, spans: NDArray, low: NDArray, cell: float) -> None:
    """How many voxels of each column (nx, ny) of the grid are solid, from below."""
    nx, ny = tops.shape
    for s in range(len(spans)):
        i0, i1 = int(np.floor((spans[s, 0, 0] - low[0]) / cell)), int(np.floor((spans[s, 1, 0] - low[0]) / cell))
        j0, j1 = int(np.floor((spans[s, 0, 1] - low[1]) / cell)), int(np.floor((spans[s, 1, 1] - low[1]) / cell))
        top = min(int(np.floor((spans[s, 1, 2] - low[2]) / cell)) + 1, nz)
        for i in range(max(i0, 0), min(i1, nx - 1) + 1):
            for j in range(max(j0, 0), min(j1, ny - 1) + 1):
                tops[i, j] = max(tops[i, j], top)


def column_distances(tops: NDArray, nz: int, cell: float, clip: float) -> NDArray:
    """Distance [m] (nx, ny, nz) float32, up to `clip`, between each voxel and the nearest of columns `tops` (nx, ny) voxels high.

    One axis after the other; the cores share the slices.
    """
    shape, gaps = (*tops.shape, nz), ((np.arange(int(np.ceil(clip / cell)) + 1) * cell) ** 2).astype(np.float32)
    along, out = np.empty(shape, np.float32), np.empty(shape, np.float32)
    share(lambda mine: _spread_columns(tops, gaps, cell, clip, mine, along), tops.shape[0])
    share(lambda mine: _spread(along, np.flatnonzero(tops.any(axis=1)), gaps, mine, out), tops.shape[0])
    return out


@njit(cache=True, nogil=True, fastmath=True)
def _spread_columns(tops: NDArray, gaps: NDArray, cell: float, clip: float, mine: NDArray, out: NDArray) -> None:
    """Squares of the distances to the columns in the same slice (ny, nz), for the slices `mine` of the first axis."""
    _, ny, nz = out.shape
    above = np.empty((ny, nz), np.float32)
    for i in mine:
        best = out[i]
        for j in range(ny):
            for k in range(nz):
                gap = np.float32(min(max(k - tops[i, j], 0) * cell, clip))
                above[j, k] = gap * gap if tops[i, j] > 0 else np.float32(clip * clip)
                best[j, k] = above[j, k]
        for j in range(ny):
            if tops[i, j] > 0:
                for other in range(max(j - len(gaps), 0), min(j + len(gaps) + 1, ny)):
                    if other != j:
                        _lower(best[other], above[j], float(gaps[abs(other - j) - 1]))


@njit(cache=True, nogil=True, fastmath=True)
def _spread(squares: NDArray, filled: NDArray, gaps: NDArray, mine: NDArray, out: NDArray) -> None:
    """Distances for the slices `mine`: the root of the least of the `filled` slices' squares plus that of the gap to them."""
    for i in mine:
        best = out[i]
        for j in range(best.shape[0]):
            put(squares[i, j], best[j])
        for other in filled:
            if other != i and abs(other - i) <= len(gaps):
                for j in range(best.shape[0]):
                    _lower(best[j], squares[other, j], float(gaps[abs(other - i) - 1]))
        for j in range(best.shape[0]):
            for k in range(best.shape[1]):
                best[j, k] = np.sqrt(best[j, k])


@njit(cache=True, nogil=True, fastmath=True)
def _lower(best: NDArray, squares: NDArray, gap: float) -> None:
    """Lowers a row to another's squares plus that of the gap."""
    for k in range(len(best)):
        best[k] = min(best[k], squares[k] + np.float32(gap))


@njit(cache=True)
def clearance_at(field: Field, x: float, y: float, z: float) -> float:
    """A lower bound [m] of the distance from a point, which the arm may reach, to everything solid."""
    bound = min(z - field.table_z, x - field.free[0, 0], field.free[1, 0] - x, y - field.free[0, 1], field.free[1, 1] - y)
    bound = min(bound, z - field.free[0, 2], field.free[1, 2] - z)
    u, v, w = (x - field.low[0]) * field.voxels, (y - field.low[1]) * field.voxels, (z - field.low[2]) * field.voxels
    nx, ny, nz = field.values.shape
    if u >= 0.0 and v >= 0.0 and w >= 0.0 and u < nx and v < ny and w < nz:
        return min(bound, field.values[int(u), int(v), int(w)])
    if nx == 0:
        return bound
    u, v, w = max(-u, u - nx, 0.0), max(-v, v - ny, 0.0), max(-w, w - nz, 0.0)
    return min(bound, field.clip + field.cell * np.sqrt(u * u + v * v + w * w))
