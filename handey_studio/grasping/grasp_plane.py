"""The grasp plane and its filled cells (Handey 1987 §5.2, Figure 9).

The grasp plane lies parallel to the grasped faces and midway between them. The hand sweeps one grasp volume for each finger, one for
the crosspiece, and one, which the paper has not, for its mount on the arm, which is narrower. From every depth point a ray goes down;
that portion of it that lies within a volume is projected onto the plane and fills the cells that it crosses. Known solids fill the cells
that they reach.

The fingers' two volumes are clipped one by one and share a grid: they move as one and have the same outline in the plane. A part in the
hand sweeps a volume of its own, as thick as the part.
"""

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.geometry import HeightField
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.world import Hand, World
from handey_studio.world.collision_bodies import TABLE_SKIN_M, solids_of

CELL_M = 0.002
WAY_IN_M = 0.12  # the bounding rectangle reaches this much farther from the grasp point than the hand is long
WAY_WITH_PART_M = 0.24  # and this much for a hand with a part in it
RAY_SPACING_M = 0.001  # finer maps are made coarser, the highest wins; coarser ones have several rays a column
SAME_AREA = 1e-14  # [m²] points that span less lie on a line, or are one
NO_CELLS = np.zeros((0, 0), dtype=bool)


class Filled(NamedTuple):
    """Filled cells (v, n, n) of the volumes in their order: fingers, crosspiece, mount, and what is held if there is something."""

    volumes: NDArray
    origin: NDArray
    cell: float


@dataclass(frozen=True, eq=False)
class GraspPlane(Value):
    """Filled cells of a grasp plane. `T_world_plane`: x along the closing direction, y and z in the plane.

    `fingers`, `crosspiece`, `mount` and, if something is held, `held` (n, n) bool: cell (i, k) covers y from origin[0] + i·cell and z from
    origin[1] + k·cell. In planes of earlier versions the mount moves in the crosspiece's volume.
    """

    T_world_plane: NDArray
    origin: NDArray
    cell: float
    fingers: NDArray
    crosspiece: NDArray
    held: NDArray = field(default_factory=lambda: NO_CELLS)
    mount: NDArray = field(default_factory=lambda: NO_CELLS)

    def __post_init__(self) -> None:
        for key in ("T_world_plane", "origin"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))
        for key in ("fingers", "crosspiece", "held", "mount"):
            object.__setattr__(self, key, frozen_array(getattr(self, key), bool))

    @cached_property
    def filled(self) -> Filled:
        """The same for the compiled functions."""
        mount = self.mount if self.mount.size else self.crosspiece
        volumes = np.stack([self.fingers, self.crosspiece, mount, *([self.held] if self.held.size else [])])
        return Filled(volumes, self.origin.copy(), self.cell)

    def is_filled(self, volume: str, points: NDArray) -> NDArray:
        """Whether points (..., 2) [m] of the plane lie in a filled cell of a volume; outside the rectangle counts as filled."""
        grid = getattr(self, volume)
        cells = np.floor((points - self.origin) / self.cell).astype(int)
        inside = ((cells >= 0) & (cells < len(grid))).all(axis=-1)
        cells = np.clip(cells, 0, len(grid) - 1)
        return grid[cells[..., 0], cells[..., 1]] | ~inside


def fill_grasp_plane(
    world: World, T_world_plane: NDArray, centre: NDArray, hand: Hand, opening: float, held: tuple[float, float] | None = None
) -> GraspPlane:
    """The grasp plane around `centre` (y, z) [m] with everything the world believes projected into it; `held` is where a part in the hand
    begins and ends along x [m]."""
    reach, half = half_size(hand, WAY_WITH_PART_M if held else WAY_IN_M), opening / 2.0
    origin = np.asarray(centre) - reach
    volumes = [
        [(-half - hand.finger_thickness, -half), (half, half + hand.finger_thickness)],
        [(-hand.crosspiece_length / 2.0, hand.crosspiece_length / 2.0)],
        [(-hand.mount_radius, hand.mount_radius)],
        *([[held]] if held else []),
    ]
    T_plane_world = inverse(T_world_plane)
    bodies = [apply(T_plane_world, corners) for _, corners in solids_of(world)]
    first, corners = np.cumsum([0] + [len(body) for body in bodies]), np.concatenate(bodies)
    points = depth_points(world.terrain, world.table_z, float(world.free_space[1, 2])) if world.terrain is not None else np.empty((0, 3))
    grids = [np.zeros((round(2 * reach / CELL_M),) * 2, dtype=np.bool_) for _ in volumes]
    for grid, slabs in zip(grids, volumes, strict=True):
        for low, high in slabs:
            _fill_bodies(grid, corners, first, origin, CELL_M, low, high)
            _fill_rays(grid, points.copy(), T_plane_world, world.table_z, origin, CELL_M, low, high)
    fingers, crosspiece, mount, *carried = grids
    return GraspPlane(T_world_plane, origin, CELL_M, fingers, crosspiece, carried[0] if carried else NO_CELLS, mount)


def half_size(hand: Hand, way: float = WAY_IN_M) -> float:
    """How far [m] the bounding rectangle reaches from the grasp point to each side, in whole cells."""
    length = max(float(hand.T_flange_hand[2, 3]), hand.finger_length + hand.crosspiece_height)
    return float(np.ceil((length + way) / CELL_M - 1e-9)) * CELL_M


@lru_cache(maxsize=8)
def depth_points(terrain: HeightField, table_z: float, ceiling: float) -> NDArray:
    """Where the rays begin (n, 3) [m] in the world: on every column that stands out of the table; no reading is solid to the ceiling."""
    field = terrain.coarsened(max(1, round(RAY_SPACING_M / terrain.cell)))
    top = np.minimum(np.where(np.isnan(field.top), np.inf, field.top), ceiling - field.T_world_range[2, 3])
    j, i = np.nonzero(top + field.T_world_range[2, 3] > table_z + TABLE_SKIN_M)
    rays = max(1, round(field.cell / RAY_SPACING_M))
    shares = (np.arange(rays) + 0.5) / rays
    points = [np.stack([(i + a) * field.cell, (j + b) * field.cell, top[j, i]], axis=1) for a in shares for b in shares]
    return frozen_array(apply(field.T_world_range, np.concatenate(points)))


@njit(cache=True)
def _fill_rays(
    grid: NDArray, points: NDArray, T_plane_world: NDArray, table_z: float, origin: NDArray, cell: float, low: float, high: float
) -> None:
    """Mark the cells that the ray down from each point (n, 3) of the world to the table crosses while low ≤ x ≤ high in the plane's frame.

    A ray stands for a column `RAY_SPACING_M` wide, so the slab is wider by half of what such a column takes of its normal.
    """
    T, half = T_plane_world, 0.5 * RAY_SPACING_M * (abs(T_plane_world[0, 0]) + abs(T_plane_world[0, 1]))
    near, far = low - half, high + half
    for r in range(len(points)):
        px, py, pz = points[r, 0], points[r, 1], points[r, 2]
        x = T[0, 0] * px + T[0, 1] * py + T[0, 2] * pz + T[0, 3]
        begin, end = 0.0, pz - table_z
        if abs(T[0, 2]) > 1e-9:
            one, other = (x - near) / T[0, 2], (x - far) / T[0, 2]
            begin, end = max(begin, min(one, other)), min(end, max(one, other))
        elif x < near or x > far:
            continue
        if begin <= end:
            y = (T[1, 0] * px + T[1, 1] * py + T[1, 2] * pz + T[1, 3] - origin[0]) / cell
            z = (T[2, 0] * px + T[2, 1] * py + T[2, 2] * pz + T[2, 3] - origin[1]) / cell
            dy, dz = -T[1, 2] / cell, -T[2, 2] / cell
            _fill_line(grid, y + begin * dy, z + begin * dz, y + end * dy, z + end * dz)


@njit(cache=True)
def _fill_line(grid: NDArray, y0: float, z0: float, y1: float, z1: float) -> None:
    """Mark every cell that a line segment crosses; coordinates count cells."""
    i, k = int(np.floor(y0)), int(np.floor(z0))
    left = abs(int(np.floor(y1)) - i) + abs(int(np.floor(z1)) - k)
    step_i, step_k = (1 if y1 > y0 else -1), (1 if z1 > z0 else -1)
    dy, dz = abs(y1 - y0), abs(z1 - z0)
    next_i = ((i + 1 - y0) if y1 > y0 else (y0 - i)) / dy if dy > 0.0 else np.inf
    next_k = ((k + 1 - z0) if z1 > z0 else (z0 - k)) / dz if dz > 0.0 else np.inf
    n = len(grid)
    while True:
        if 0 <= i < n and 0 <= k < n:
            grid[i, k] = True
        if left == 0:
            return
        left -= 1
        if next_i < next_k:
            i += step_i
            next_i += 1.0 / dy
        else:
            k += step_k
            next_k += 1.0 / dz


@njit(cache=True)
def _fill_bodies(grid: NDArray, corners: NDArray, first: NDArray, origin: NDArray, cell: float, low: float, high: float) -> None:
    """Mark the cells that the projection of each convex body touches, of what is left of it in the slab low ≤ x ≤ high."""
    for b in range(len(first) - 1):
        points, count = _clipped(corners, first[b], first[b + 1], low, high)
        polygon, sides = _hull(points, count)
        if sides > 2:
            _fill_polygon(grid, polygon, sides, origin, cell)


@njit(cache=True)
def _clipped(corners: NDArray, first: int, last: int, low: float, high: float) -> tuple[NDArray, int]:
    """Points (y, z) whose hull is the projection of a body between low and high, and how many they are: its corners there, and where the
    lines between any two of its corners pierce the slab's faces."""
    points, count = np.empty(((last - first) * (last - first), 2)), 0
    for i in range(first, last):
        if low <= corners[i, 0] <= high:
            points[count, 0], points[count, 1] = corners[i, 1], corners[i, 2]
            count += 1
        for j in range(first, i):
            for face in (low, high):
                if (corners[i, 0] - face) * (corners[j, 0] - face) < 0.0:
                    share = (face - corners[i, 0]) / (corners[j, 0] - corners[i, 0])
                    points[count, 0] = corners[i, 1] + share * (corners[j, 1] - corners[i, 1])
                    points[count, 1] = corners[i, 2] + share * (corners[j, 2] - corners[i, 2])
                    count += 1
    return points, count


@njit(cache=True)
def _hull(points: NDArray, count: int) -> tuple[NDArray, int]:
    """Corners of the hull of the first `count` points, counter-clockwise, and how many they are: wrapped from the leftmost on."""
    hull, sides, at = np.empty((count + 1, 2)), 0, 0
    for k in range(1, count):
        if points[k, 0] < points[at, 0] or (points[k, 0] == points[at, 0] and points[k, 1] < points[at, 1]):
            at = k
    begin = at
    while sides < count:
        hull[sides, 0], hull[sides, 1] = points[at, 0], points[at, 1]
        sides += 1
        ahead = begin
        for k in range(count):
            y, z = points[k, 0] - points[at, 0], points[k, 1] - points[at, 1]
            ay, az = points[ahead, 0] - points[at, 0], points[ahead, 1] - points[at, 1]
            turn = ay * z - az * y
            if turn < -SAME_AREA or (abs(turn) <= SAME_AREA and y * y + z * z > ay * ay + az * az):
                ahead = k  # to the right of all before, or as far to the right and farther
        at = ahead
        if (points[at, 0] - hull[0, 0]) ** 2 + (points[at, 1] - hull[0, 1]) ** 2 <= SAME_AREA:
            break
    return hull, sides


@njit(cache=True)
def _fill_polygon(grid: NDArray, polygon: NDArray, sides: int, origin: NDArray, cell: float) -> None:
    """Mark the cells that a convex polygon [m] reaches into; a cell just off one of its corners may count as well."""
    n, low_y, high_y, low_z, high_z = len(grid), np.inf, -np.inf, np.inf, -np.inf
    for c in range(sides):
        low_y, high_y = min(low_y, polygon[c, 0]), max(high_y, polygon[c, 0])
        low_z, high_z = min(low_z, polygon[c, 1]), max(high_z, polygon[c, 1])
    for i in range(max(0, int(np.floor((low_y - origin[0]) / cell))), min(n, int(np.floor((high_y - origin[0]) / cell)) + 1)):
        y, low, high = origin[0] + (i + 0.5) * cell, low_z - 0.5 * cell, high_z + 0.5 * cell  # of the centres that are filled
        for c in range(sides):
            after = (c + 1) % sides
            ny, nz = polygon[after, 1] - polygon[c, 1], polygon[c, 0] - polygon[after, 0]  # outward
            room = 0.5 * cell * (abs(ny) + abs(nz)) - ny * (y - polygon[c, 0])
            if nz > 0.0:
                high = min(high, polygon[c, 1] + room / nz)
            elif nz < 0.0:
                low = max(low, polygon[c, 1] + room / nz)
            elif room <= 0.0:
                high = low
        if low < high:
            first, last = int(np.floor((low - origin[1]) / cell + 0.5)), int(np.ceil((high - origin[1]) / cell - 0.5))
            for k in range(max(0, first), min(n, last)):
                grid[i, k] = True
