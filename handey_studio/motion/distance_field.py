"""A conservative distance field of the scene: at any point, a number that the distance to everything solid never falls below."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.world import World
from handey_studio.world.collision import collision_model
from handey_studio.world.collision_bodies import Obstacles
from handey_studio.world.gjk import distance

CLIP_M = 0.25  # farther than this nothing is told apart: more than a cell of the configuration space moves anything
FINEST_M = 0.01
MOST_VOXELS = 800_000


class Field(NamedTuple):
    """`values[i, j, k]` [m] is the distance from the centre of a voxel, `cell` [m] wide, `low` (3,) the grid's lower corner, to the
    nearest voxel that holds something, up to `clip`. The table and the walls of the free space `free` (2, 3) are planes apart from it.
    """

    low: NDArray
    cell: float
    values: NDArray
    clip: float
    table_z: float
    free: NDArray


@lru_cache(maxsize=8)
def distance_field(world: World) -> Field:
    """The field of a world's blocks, parts and depth map, kept warm in this process."""
    model = collision_model(world)
    solids, terrain = model.solids, model.terrain
    solid = np.arange(model.slabs, len(solids.name))
    spans = [_spans(solids)[solid], _spans(terrain)]
    boxes = np.concatenate(spans)
    boxes[:, 0] = np.maximum(boxes[:, 0], [*world.free_space[0, :2], max(world.table_z, world.free_space[0, 2])])
    boxes[:, 1] = np.minimum(boxes[:, 1], world.free_space[1])
    boxes = boxes[(boxes[:, 1] > boxes[:, 0]).all(axis=1)]
    if not len(boxes):
        boxes = np.zeros((1, 2, 3))
    low, high = boxes[:, 0].min(axis=0) - CLIP_M, boxes[:, 1].max(axis=0) + CLIP_M
    cell = max(FINEST_M, float(np.cbrt(np.prod(high - low) / MOST_VOXELS)))
    taken = np.zeros(np.ceil((high - low) / cell).astype(int), np.bool_)
    _fill_columns(taken, _spans(terrain), low, cell)
    _fill_bodies(taken, solids, solid, low, cell)
    return Field(low, cell, box_distances(taken, cell, CLIP_M), CLIP_M, world.table_z, np.array(world.free_space))


def _spans(fixed: Obstacles) -> NDArray:
    """Lower and upper corners (k, 2, 3) [m] of fixed bodies."""
    if not len(fixed.name):
        return np.empty((0, 2, 3))
    starts = fixed.first[:-1]
    return np.stack([np.minimum.reduceat(fixed.corners, starts), np.maximum.reduceat(fixed.corners, starts)], axis=1)


@njit(cache=True)
def _fill_columns(taken: NDArray, spans: NDArray, low: NDArray, cell: float) -> None:
    nx, ny, nz = taken.shape
    for s in range(len(spans)):
        i0, i1 = int((spans[s, 0, 0] - low[0]) // cell), int((spans[s, 1, 0] - low[0]) // cell)
        j0, j1 = int((spans[s, 0, 1] - low[1]) // cell), int((spans[s, 1, 1] - low[1]) // cell)
        k1 = int((spans[s, 1, 2] - low[2]) // cell)
        taken[max(i0, 0) : min(i1, nx - 1) + 1, max(j0, 0) : min(j1, ny - 1) + 1, : min(k1, nz - 1) + 1] = True


@njit(cache=True)
def _fill_bodies(taken: NDArray, fixed: Obstacles, chosen: NDArray, low: NDArray, cell: float) -> None:
    """Voxels that a convex body meets."""
    voxel, first, last = np.empty((8, 3)), np.zeros(3, np.int64), np.zeros(3, np.int64)
    for body in chosen:
        a, b = int(fixed.first[body]), int(fixed.first[body + 1])
        for axis in range(3):
            first[axis] = max(int((fixed.corners[a:b, axis].min() - low[axis]) // cell), 0)
            last[axis] = min(int((fixed.corners[a:b, axis].max() - low[axis]) // cell), taken.shape[axis] - 1)
        for i in range(first[0], last[0] + 1):
            for j in range(first[1], last[1] + 1):
                for k in range(first[2], last[2] + 1):
                    for c in range(8):
                        voxel[c, 0] = low[0] + (i + (c & 1)) * cell
                        voxel[c, 1] = low[1] + (j + ((c >> 1) & 1)) * cell
                        voxel[c, 2] = low[2] + (k + ((c >> 2) & 1)) * cell
                    taken[i, j, k] |= distance(voxel, 0, 8, fixed.corners, a, b, 1e-9) <= 0.0


@njit(cache=True)
def _sweep(squares: NDArray, reach: int, cell: float) -> NDArray:
    """One axis (the last) of the distance transform: the least of each neighbour's square plus the gap's."""
    nx, ny, nz = squares.shape
    out = squares.copy()
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                best = squares[i, j, k]
                for step in range(1, reach + 1):
                    gap = (step - 0.5) * cell
                    if gap * gap >= best:
                        break
                    if k - step >= 0:
                        best = min(best, squares[i, j, k - step] + gap * gap)
                    if k + step < nz:
                        best = min(best, squares[i, j, k + step] + gap * gap)
                out[i, j, k] = best
    return out


def box_distances(taken: NDArray, cell: float, clip: float) -> NDArray:
    """Exact distance [m] (float32) from each voxel's centre to the nearest taken voxel taken as a box, up to `clip`."""
    squares = np.where(taken, 0.0, clip * clip)
    reach = int(np.ceil(clip / cell)) + 1
    for axis in (2, 1, 0):
        turned = np.ascontiguousarray(np.moveaxis(squares, axis, -1))
        squares = np.moveaxis(_sweep(turned, reach, cell), -1, axis)
    return np.ascontiguousarray(np.sqrt(squares), dtype=np.float32)


@njit(cache=True)
def clearance_at(field: Field, x: float, y: float, z: float) -> float:
    """A lower bound [m] of the distance from a point to everything solid; at most `clip` away from the planes."""
    bound = min(z - field.table_z, x - field.free[0, 0], field.free[1, 0] - x, y - field.free[0, 1], field.free[1, 1] - y)
    bound = min(bound, z - field.free[0, 2], field.free[1, 2] - z)
    u, v, w = (x - field.low[0]) / field.cell, (y - field.low[1]) / field.cell, (z - field.low[2]) / field.cell
    i, j, k = int(np.floor(u)), int(np.floor(v)), int(np.floor(w))
    nx, ny, nz = field.values.shape
    if i < 0 or j < 0 or k < 0 or i >= nx or j >= ny or k >= nz:
        return min(bound, field.clip)
    u, v, w = u - i - 0.5, v - j - 0.5, w - k - 0.5
    return min(bound, field.values[i, j, k] - field.cell * np.sqrt(u * u + v * v + w * w))
