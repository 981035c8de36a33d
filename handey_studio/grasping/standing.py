"""Whether a part stays up where it is put: its weight above what it stands on."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.geometry.transforms import apply
from handey_studio.grasping.solid_heights import body_cells, body_planes
from handey_studio.world import PlacedPart, World
from handey_studio.world.collision_bodies import TABLE_SKIN_M, slabs_of, solids_of
from handey_studio.world.support import TOUCHING_M

CELL_M = 0.001  # of the grid on which underside and ground are held against each other


def topples_by(world: World, placed: PlacedPart) -> float:
    """How far [m] beyond what it would stand on a part's centre of mass lies, seen from above; negative if it stands.

    Contact is wherever its underside comes within `TOUCHING_M` of the highest ground below it, made up to a cell larger. The world must not
    hold the part itself. Infinite if there is nothing below it.
    """
    origin = np.floor(placed.corners_world[:, :2].min(axis=0) / CELL_M - 2) * CELL_M
    shape = tuple((np.ceil((placed.corners_world[:, :2].max(axis=0) - origin) / CELL_M) + 2).astype(int))
    underside = np.full(shape, np.inf)
    for piece in placed.part.pieces:
        _cover(underside, apply(placed.T_world_part, piece), origin, False)
    gaps = underside - _ground(world, origin, shape, float(placed.corners_world[:, 2].max()))
    gaps[gaps < -TOUCHING_M] = np.inf  # a cell that has a wall beside the part in it
    if not np.isfinite(gaps).any():
        return float("inf")
    cells = np.argwhere(gaps <= gaps.min() + TOUCHING_M)
    corners = (cells[:, None] + np.array([(0, 0), (0, 1), (1, 0), (1, 1)])).reshape(-1, 2) * CELL_M + origin
    centre = apply(placed.T_world_part, placed.part.solid.volume_and_centroid[1])[:2]
    sides = ConvexHull(corners).equations
    return float((sides[:, :2] @ centre + sides[:, 2]).max())


def _ground(world: World, origin: NDArray, shape: tuple[int, ...], top: float) -> NDArray:
    """How high [m] all that begins below `top` reaches over each cell of a grid, -∞ where nothing is."""
    ground = np.full(shape, world.table_z)
    for _, corners in solids_of(world)[len(slabs_of(world)) :]:
        if corners[:, 2].min() < top:
            _cover(ground, corners, origin, True)
    if world.terrain is None:
        return ground
    x, y = (origin[a] + (np.arange(shape[a]) + 0.5) * CELL_M for a in (0, 1))
    points = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros(shape)], axis=-1)
    field = world.terrain
    j, i, inside = field.indices((points - field.T_world_range[:3, 3]) @ field.T_world_range[:3, :3])
    seen = np.nan_to_num(field.top[j, i], nan=-np.inf) + field.T_world_range[2, 3]
    return np.where(inside & (seen > world.table_z + TABLE_SKIN_M) & (seen < top), np.maximum(ground, seen), ground)


def _cover(heights: NDArray, corners: NDArray, origin: NDArray, upper: bool) -> None:
    """Raise the cells that a convex body covers to its top, or lower them to its underside."""
    lower, covered, reach = body_cells(corners, body_planes(corners), origin, CELL_M, upper=upper)
    low, high = np.maximum(lower, 0), np.minimum(lower + covered.shape, heights.shape)
    if (high <= low).any():
        return
    window = tuple(slice(a, b) for a, b in zip(low - lower, high - lower, strict=True))
    cells = heights[low[0] : high[0], low[1] : high[1]]
    better = np.maximum(cells, reach[window]) if upper else np.minimum(cells, reach[window])
    cells[covered[window]] = better[covered[window]]
