"""The depth map's columns in the way of a hand that turns in the grasp plane: solid all the way down (Handey 1987 §5.2's rays).

The plane is ruled in strips that run the way the columns do; what the columns fill of a strip is taken for a stretch as wide as it.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.geometry import HeightField
from handey_studio.grasping.forbidden_angles import insert, join_nearest, stretch_ranges
from handey_studio.grasping.plane_obstacles import Volumes
from handey_studio.world.collision_bodies import COLUMN_M, TABLE_SKIN_M
from handey_studio.world.vectors import Vector, dot, plus, times

BIN_M = 0.0005  # columns of the depth map are gathered in strips this wide, across the direction in which they go down
MOST_RUNS = 8  # of one strip; with more, the nearest two become one


class Columns(NamedTuple):
    """The depth map's columns: `tops` (ny, nx) [m] in the world, -inf where nothing stands out of the table; `T_world_range`, `cell` [m],
    and where the columns end below."""

    tops: NDArray
    T_world_range: NDArray
    cell: float
    bottom: float


@lru_cache(maxsize=8)
def depth_columns(terrain: HeightField, table_z: float, ceiling: float) -> Columns:
    """The columns of a depth map that stand out of the table, kept from world to world; no reading is solid to the ceiling."""
    field = terrain.coarsened(max(1, round(COLUMN_M / terrain.cell)))
    tops = np.minimum(np.where(np.isnan(field.top), np.inf, field.top + field.T_world_range[2, 3]), ceiling)
    return Columns(np.where(tops > table_z + TABLE_SKIN_M, tops, -np.inf), np.array(field.T_world_range), float(field.cell), float(table_z))


@njit(cache=True)
def add_columns(
    columns: Columns, T_world_plane: NDArray, volumes: Volumes, window: tuple[float, float], ranges: NDArray, counts: NDArray, body: int
) -> None:
    """Adds the angles that the columns forbid, each with its square of the map, to the ranges of a body.

    `T_world_plane` (4, 4) has its origin at the grasp point.
    """
    found, half = np.empty((6, 2)), BIN_M / 2.0
    for v in range(len(volumes.slabs)):
        runs, counts_of, across, up = filled_strips(columns, T_world_plane, volumes.slabs[v], volumes.boxes[v])
        box = (volumes.boxes[v, 0] + half, volumes.boxes[v, 1] - half, volumes.boxes[v, 2] + half)
        for i in range(len(runs)):
            h = (i + 0.5 - 0.5 * len(runs)) * BIN_M
            y, z = h * across[0], h * across[1]
            for k in range(counts_of[i]):
                a, b = runs[i, k, 0], runs[i, k, 1]
                n = stretch_ranges(y + a * up[0], z + a * up[1], y + b * up[0], z + b * up[1], box, found)
                for f in range(n):
                    insert(found[f, 0], found[f, 1], window, ranges, counts, body)


Strips = tuple[NDArray, NDArray, tuple[float, float], tuple[float, float]]


@njit(cache=True)
def filled_strips(columns: Columns, T: NDArray, slab: NDArray, box: NDArray) -> Strips:
    """What the columns fill of each strip of the square around the point: runs (strips, MOST_RUNS, 2) [m] from where to where along it, how
    many there are (strips,), and the directions, in y and z, across the strips and up along them."""
    steep = np.sqrt(T[2, 1] ** 2 + T[2, 2] ** 2)
    up = (T[2, 1] / steep, T[2, 2] / steep) if steep > 1e-9 else (0.0, 1.0)
    across = (up[1], -up[0])
    strips = 2 * int(np.ceil((np.sqrt(box[0] ** 2 + box[2] ** 2) + BIN_M) / BIN_M))
    reach = 0.5 * BIN_M * strips
    runs, counts = np.empty((strips, MOST_RUNS, 2)), np.zeros(strips, np.int64)
    closing, y, z = _axis(T, 0), _axis(T, 1), _axis(T, 2)
    side, rise = plus(times(across[0], y), times(across[1], z)), plus(times(up[0], y), times(up[1], z))
    feet = _footprint(columns, closing), _footprint(columns, side), _footprint(columns, rise)
    far = np.sqrt(reach * reach + max(-slab[0], slab[1]) ** 2) + columns.cell
    rows, cols = _near(columns, T[0, 3], T[1, 3], far)
    R, cell = columns.T_world_range, columns.cell
    for j in range(rows[0], rows[1]):
        for i in range(cols[0], cols[1]):
            top = columns.tops[j, i] - T[2, 3]
            if top < -far:
                continue
            dx = R[0, 0] * (i + 0.5) * cell + R[0, 1] * (j + 0.5) * cell + R[0, 3] - T[0, 3]
            dy = R[1, 0] * (i + 0.5) * cell + R[1, 1] * (j + 0.5) * cell + R[1, 3] - T[1, 3]
            offset = (dx, dy, top)
            x, h, s = dot(offset, closing), dot(offset, side), dot(offset, rise)
            first, last = _in_slab(x, closing[2], slab[0] - feet[0], slab[1] + feet[0], columns.tops[j, i] - columns.bottom)
            high, low = min(s - steep * first + feet[2], reach), max(s - steep * last - feet[2], -reach)
            if first > last or low > high or h - feet[1] >= reach or h + feet[1] <= -reach:
                continue
            for k in range(max(0, int((h - feet[1] + reach) / BIN_M)), min(strips, int((h + feet[1] + reach) / BIN_M) + 1)):
                _fill(runs, counts, k, low, high)
    return runs, counts, across, up


@njit(cache=True)
def _fill(runs: NDArray, counts: NDArray, k: int, low: float, high: float) -> None:
    """Adds a run to those of strip k, made one with those that it touches."""
    j = 0
    while j < counts[k]:
        if runs[k, j, 0] <= low and high <= runs[k, j, 1]:
            return
        if runs[k, j, 0] <= high and low <= runs[k, j, 1]:
            low, high = min(low, runs[k, j, 0]), max(high, runs[k, j, 1])
            counts[k] -= 1
            runs[k, j, 0], runs[k, j, 1] = runs[k, counts[k], 0], runs[k, counts[k], 1]
            j = 0
        else:
            j += 1
    if counts[k] == MOST_RUNS:
        join_nearest(runs[k], counts, k)
    runs[k, counts[k], 0], runs[k, counts[k], 1] = low, high
    counts[k] += 1


@njit(cache=True)
def _axis(T: NDArray, k: int) -> Vector:
    """Axis k of a frame."""
    return T[0, k], T[1, k], T[2, k]


@njit(cache=True)
def _footprint(columns: Columns, direction: Vector) -> float:
    """How far [m] a column's square reaches from its middle along a direction of the world."""
    R = columns.T_world_range
    x, y = R[0, 0] * direction[0] + R[1, 0] * direction[1], R[0, 1] * direction[0] + R[1, 1] * direction[1]
    return 0.5 * columns.cell * (abs(x) + abs(y))


@njit(cache=True)
def _near(columns: Columns, px: float, py: float, far: float) -> tuple[tuple[int, int], tuple[int, int]]:
    """Rows and columns of the map, from and to, within `far` [m] of a point of the world."""
    R = columns.T_world_range
    dx, dy = px - R[0, 3], py - R[1, 3]
    x, y = R[0, 0] * dx + R[1, 0] * dy, R[0, 1] * dx + R[1, 1] * dy
    ny, nx = columns.tops.shape
    rows = max(0, int((y - far) / columns.cell)), min(ny, int((y + far) / columns.cell) + 1)
    return rows, (max(0, int((x - far) / columns.cell)), min(nx, int((x + far) / columns.cell) + 1))


@njit(cache=True)
def _in_slab(x: float, slope: float, low: float, high: float, most: float) -> tuple[float, float]:
    """From how far below its top to how far a column's middle, which starts at x and moves by -slope for each metre down, is in a slab."""
    if abs(slope) < 1e-9:
        return (0.0, most) if low <= x <= high else (1.0, 0.0)
    one, other = (x - high) / slope, (x - low) / slope
    return max(0.0, min(one, other)), min(most, max(one, other))
