"""How high everything solid reaches, seen from above, on a grid; and how low a body hangs over each of its cells."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.base import Value, frozen_array
from handey_studio.geometry import HeightField
from handey_studio.geometry.transforms import apply
from handey_studio.world import World
from handey_studio.world.collision_bodies import TABLE_SKIN_M, slabs_of, solids_of

ROUNDING_M = 1e-9
LEVEL_NORMAL = 1e-6  # a facet whose normal's z is smaller than this stands upright


@dataclass(frozen=True, eq=False)
class SolidHeights(Value):
    """`heights` (nx, ny) [m] in the world: cell (i, k) covers x from origin[0] + i·cell and y from origin[1] + k·cell, and nothing in it is
    solid above its height. `seen` (nx, ny) are the cells that the depth map covers."""

    origin: NDArray
    cell: float
    heights: NDArray
    seen: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "origin", frozen_array(self.origin))
        object.__setattr__(self, "heights", frozen_array(self.heights))
        object.__setattr__(self, "seen", frozen_array(self.seen, bool))

    def centres(self, step: int) -> NDArray:
        """World x, y [m] of the centres (a, b, 2) of every `step`-th cell."""
        x, y = (low + (np.arange(0, n, step) + 0.5) * self.cell for low, n in zip(self.origin, self.heights.shape, strict=True))
        return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)


@lru_cache(maxsize=8)
def solid_heights(world: World, x: tuple[float, float], y: tuple[float, float], cell: float) -> SolidHeights:
    """The heights over a rectangle of the world [m]: the table, the depth map's columns, blocks and parts; infinite outside the free space.

    Rounded up everywhere: a cell is as high as the highest that reaches into it. Without a table there is nothing (-∞) between bodies.
    """
    origin = np.array([x[0], y[0]])
    shape = round((x[1] - x[0]) / cell), round((y[1] - y[0]) / cell)
    heights, seen = np.full(shape, world.table_z), np.zeros(shape, dtype=bool)
    if world.terrain is not None:
        _raise_terrain(heights, seen, world.terrain, world, origin, cell)
    for _, corners in solids_of(world)[len(slabs_of(world)) :]:
        lower, covered, top = body_cells(corners, body_planes(corners), origin, cell, upper=True)
        i0, k0 = np.maximum(lower, 0)
        i1, k1 = np.minimum(lower + covered.shape, shape)
        if i1 > i0 and k1 > k0:
            window = (slice(i0 - lower[0], i1 - lower[0]), slice(k0 - lower[1], k1 - lower[1]))
            heights[i0:i1, k0:k1] = np.maximum(heights[i0:i1, k0:k1], np.where(covered[window], top[window], -np.inf))
    low, high = world.free_space[:, :2]
    edges = [origin[a] + np.arange(shape[a]) * cell for a in (0, 1)]
    inside = [(edge >= low[a]) & (edge + cell <= high[a]) for a, edge in enumerate(edges)]
    heights[~(inside[0][:, None] & inside[1][None, :])] = np.inf
    return SolidHeights(origin, cell, heights, seen)


def _raise_terrain(heights: NDArray, seen: NDArray, terrain: HeightField, world: World, origin: NDArray, cell: float) -> None:
    """Raise each cell to the columns that reach into it; readings within the table's skin are the table's own."""
    field = terrain.coarsened(max(1, int(cell / terrain.cell)))
    top = np.minimum(np.where(np.isnan(field.top), np.inf, field.top) + field.T_world_range[2, 3], float(world.free_space[1, 2]))
    top = np.where(top <= world.table_z + TABLE_SKIN_M, world.table_z, top)
    j, i = np.meshgrid(*(np.arange(n) for n in top.shape), indexing="ij")
    shares = np.linspace(0.001, 0.999, max(3, int(np.ceil(field.cell / cell)) + 1))  # no farther apart than the cells of the grid
    for dx, dy in product(shares, shares):
        points = apply(field.T_world_range, np.stack([(i + dx) * field.cell, (j + dy) * field.cell, np.zeros(i.shape)], axis=-1))
        cells = np.floor((points[..., :2] - origin) / cell).astype(int)
        known = ((cells >= 0) & (cells < heights.shape)).all(axis=-1)
        at = cells[known]
        np.maximum.at(heights, (at[:, 0], at[:, 1]), top[known])
        seen[at[:, 0], at[:, 1]] = True


def body_planes(corners: NDArray) -> NDArray:
    """Planes (m, 4) around a convex body of corners (n, 3), n·p + offset ≤ 0 inside: its faces', and upright ones around its outline as
    it is seen from above."""
    flat = ConvexHull(corners[:, :2]).equations
    outline = np.c_[flat[:, :2], np.zeros(len(flat)), flat[:, 2]]
    return np.unique(np.round(np.concatenate([ConvexHull(corners).equations, outline]), 10), axis=0)


def body_cells(
    corners: NDArray, planes: NDArray, origin: NDArray, cell: float, upper: bool, grown: float = 0.0
) -> tuple[NDArray, NDArray, NDArray]:
    """A convex body of corners (n, 3) [m] and planes (m, 4), grown by `grown` [m] to all sides, over the cells of a grid.

    The first cell (2,) of a window, which of its cells (a, b) the body covers, and how high it reaches (`upper`), or else how low it hangs,
    over each. On the safe side: the body counts as covering a cell that it may just miss, and as a little higher or lower than it is.
    """
    lower = np.floor((corners[:, :2].min(axis=0) - grown - origin) / cell).astype(int)
    count = np.floor((corners[:, :2].max(axis=0) + grown - origin) / cell).astype(int) + 1 - lower
    x, y = (origin[a] + (lower[a] + np.arange(count[a]) + 0.5) * cell for a in (0, 1))
    sign = 1.0 if upper else -1.0
    # The least of n·p + offset over each cell, less its share of z.
    reaches = planes[:, 3] - grown - 0.5 * cell * np.abs(planes[:, :2]).sum(axis=1)
    reaches = reaches[:, None, None] + planes[:, 0, None, None] * x[:, None] + planes[:, 1, None, None] * y
    facing, upright = sign * planes[:, 2] > LEVEL_NORMAL, np.abs(planes[:, 2]) <= LEVEL_NORMAL
    limit = (-reaches[facing] / (sign * planes[facing, 2])[:, None, None]).min(axis=0)
    covered = (reaches[upright] <= ROUNDING_M).all(axis=0)
    return lower, covered, sign * np.minimum(limit, (sign * corners[:, 2]).max() + grown)
