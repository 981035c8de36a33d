"""The grasp plane and its filled cells (Handey 1987 §5.2, Figure 9).

The grasp plane lies parallel to the grasped faces and midway between them. The hand sweeps one grasp volume for each finger and
one for the crosspiece (its mount on the arm moves in the crosspiece's). From every depth point a ray goes down; where it passes
through a volume it is projected onto the plane and fills cells there. Known solids fill the cells that they reach.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.base import Value, frozen_array
from handey_studio.geometry import HeightField
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.world import Hand, World

CELL_M = 0.002
HALF_SIZE_M = 0.22  # the bounding rectangle reaches this far from the grasp point: the hand's whole length and its way in
RAYS_OF_COLUMN = np.array([[0.0, 0.0], [-0.49, -0.49], [-0.49, 0.49], [0.49, -0.49], [0.49, 0.49]])  # a column is as wide as its cell
RAY_BOTTOM_M = 0.01  # rays end this far below the table's top: the table fills the rest


@dataclass(frozen=True, eq=False)
class GraspPlane(Value):
    """Filled cells of a grasp plane. `T_world_plane`: x along the closing direction, y and z in the plane.

    `fingers` and `crosspiece` (n, n) bool: cell (i, k) covers y from origin[0] + i·cell and z from origin[1] + k·cell.
    """

    T_world_plane: NDArray
    origin: NDArray
    cell: float
    fingers: NDArray
    crosspiece: NDArray

    def __post_init__(self) -> None:
        for key in ("T_world_plane", "origin"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))
        for key in ("fingers", "crosspiece"):
            object.__setattr__(self, key, frozen_array(getattr(self, key), bool))

    def is_filled(self, volume: str, points: NDArray) -> NDArray:
        """Whether points (..., 2) [m] of the plane lie in a filled cell of a volume; outside the rectangle counts as filled."""
        grid = self.fingers if volume == "fingers" else self.crosspiece
        cells = np.floor((points - self.origin) / self.cell).astype(int)
        inside = ((cells >= 0) & (cells < len(grid))).all(axis=-1)
        cells = np.clip(cells, 0, len(grid) - 1)
        return grid[cells[..., 0], cells[..., 1]] | ~inside


def fill_grasp_plane(world: World, T_world_plane: NDArray, centre: NDArray, hand: Hand, opening: float) -> GraspPlane:
    """The grasp plane around `centre` (y, z) [m] with everything the world believes projected into it."""
    origin = np.asarray(centre) - HALF_SIZE_M
    n = round(2 * HALF_SIZE_M / CELL_M)
    half = opening / 2.0
    finger_slabs = np.array([[-half - hand.finger_thickness, -half], [half, half + hand.finger_thickness]])
    cross_slabs = np.array([[-hand.crosspiece_length / 2.0, hand.crosspiece_length / 2.0]])
    grids = []
    for slabs in (finger_slabs, cross_slabs):
        grid = np.zeros((n, n), dtype=np.bool_)
        for low, high in slabs:
            _fill_slab(grid, world, T_world_plane, origin, float(low), float(high))
        grids.append(grid)
    return GraspPlane(T_world_plane, origin, CELL_M, grids[0], grids[1])


def _fill_slab(grid: NDArray, world: World, T_world_plane: NDArray, origin: NDArray, low: float, high: float) -> None:
    """Fill the cells of the slab low ≤ x ≤ high of the plane's frame."""
    if world.terrain is not None:
        terrain = world.terrain.coarsened(max(1, round(CELL_M / world.terrain.cell)))
        tops = _column_tops(terrain, world.table_z, T_world_plane, low, high)
        T_plane_world = inverse(T_world_plane)
        lengths = np.tile(tops[:, 2] - (world.table_z - RAY_BOTTOM_M), len(RAYS_OF_COLUMN))
        rays = np.concatenate([tops + terrain.T_world_range[:3, :2] @ offset for offset in RAYS_OF_COLUMN * terrain.cell])
        down = -T_plane_world[:3, 2]
        _fill_rays(grid, apply(T_plane_world, rays), lengths, np.ascontiguousarray(down), origin, CELL_M, low, high)
    planes, counts = _half_spaces(world, T_world_plane)
    samples = np.linspace(low, high, max(2, round((high - low) / (2 * CELL_M)) + 1))
    _fill_solids(grid, planes, counts, origin, CELL_M, samples)


def _column_tops(terrain: HeightField, table_z: float, T_world_plane: NDArray, low: float, high: float) -> NDArray:
    """Tops (k, 3) [m] of the columns that stand above the table and near the slab, in the world frame."""
    j, i = np.nonzero(terrain.top + terrain.T_world_range[2, 3] > table_z + 1e-3)
    tops = apply(terrain.T_world_range, np.c_[(i + 0.5) * terrain.cell, (j + 0.5) * terrain.cell, terrain.top[j, i]])
    tops = tops[np.isfinite(tops[:, 2])]
    axis, centre = T_world_plane[:3, 0], T_world_plane[:3, 3]
    # A ray that starts beside the slab can only enter it by the slab's slope: over the ray's length it moves |axis_z| of it sideways.
    drift = abs(axis[2]) * (tops[:, 2] - table_z + RAY_BOTTOM_M) + terrain.cell
    x = (tops - centre) @ axis
    return tops[(x > low - drift) & (x < high + drift)]


@njit(cache=True)
def _fill_rays(
    grid: NDArray, starts: NDArray, lengths: NDArray, down: NDArray, origin: NDArray, cell: float, low: float, high: float
) -> None:
    """Mark the cells that each downward ray crosses while it is inside the slab."""
    n = len(grid)
    for r in range(len(starts)):
        t = 0.0
        while t <= lengths[r]:
            x = starts[r, 0] + t * down[0]
            if x >= low - 0.5 * cell and x <= high + 0.5 * cell:
                i = int(np.floor((starts[r, 1] + t * down[1] - origin[0]) / cell))
                k = int(np.floor((starts[r, 2] + t * down[2] - origin[1]) / cell))
                if 0 <= i < n and 0 <= k < n:
                    grid[i, k] = True
            t += 0.35 * cell


@njit(cache=True)
def _fill_solids(grid: NDArray, planes: NDArray, counts: NDArray, origin: NDArray, cell: float, samples: NDArray) -> None:
    """Mark the cells that reach into a convex solid at one of the sampled depths; planes (m, 4) with outward normals."""
    n = len(grid)
    for i in range(n):
        y = origin[0] + (i + 0.5) * cell
        for k in range(n):
            z = origin[1] + (k + 0.5) * cell
            first = 0
            for c in counts:
                for x in samples:
                    inside = True
                    for p in range(first, first + c):
                        if planes[p, 0] * x + planes[p, 1] * y + planes[p, 2] * z + planes[p, 3] > 0.0:
                            inside = False
                            break
                    if inside:
                        grid[i, k] = True
                        break
                first += c
                if grid[i, k]:
                    break


def _half_spaces(world: World, T_world_plane: NDArray) -> tuple[NDArray, NDArray]:
    """Planes (m, 4) of all known convex solids in the plane's frame, and how many each solid has."""
    T_plane_world = inverse(T_world_plane)
    solids = [T_plane_world[:3, :3] @ np.array([0.0, 0.0, 1.0])]
    table = np.append(solids[0], T_plane_world[:3, 3] @ solids[0] * -1 - world.table_z)
    rows, counts = [table[None]], [1]
    corners = [block.corners_world for block in world.blocks]
    corners += [apply(placed.T_world_part, piece) for placed in world.parts for piece in placed.part.pieces]
    for piece in corners:
        equations = np.unique(np.round(ConvexHull(apply(T_plane_world, piece)).equations, 10), axis=0)
        rows.append(equations)
        counts.append(len(equations))
    return np.concatenate(rows), np.array(counts)
