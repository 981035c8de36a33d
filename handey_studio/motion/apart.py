"""The proof that there is no path: start and goal stay apart although nothing but wholly blocked cells is taken out.

A cell is wholly blocked when a ball inside a link up to the wrist's carrier surely meets something solid at every configuration of the
cell. What the wrist carries and the arm itself are passed over, and of what a held joint turns all but the balls around its axis: no way is
refused that might be there.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from handey_studio.geometry.transforms import inverse
from handey_studio.motion.configuration_space import TURN, Extent
from handey_studio.motion.cores import share
from handey_studio.motion.distance_field import faces_by_direction
from handey_studio.motion.forbidden_ranges import product, turned
from handey_studio.motion.inner_balls import InnerBalls, inner_balls, unturned
from handey_studio.motion.query import Query
from handey_studio.motion.regions import Regions, free_regions
from handey_studio.motion.turning import hinges_of
from handey_studio.world import Robot, World
from handey_studio.world.collision import collision_model
from handey_studio.world.collision_bodies import TABLE_SKIN_M

STEP_RAD = float(np.deg2rad(2.5))
WIDE_M = (0.0, 0.02, 0.04, 0.08)


class Ground(NamedTuple):
    """The depth map as the proof sees it: `tops` (4, ny, nx) [m] in its range frame, the first as they are, the others the least ones as
    far around as `WIDE_M` tells; minus infinity beyond the map and where it is no higher than the table. Columns are `cell` [m] wide;
    `highest` [m] is the highest top in the world.
    """

    tops: NDArray
    cell: float
    T_range_world: NDArray
    highest: float


def surely_apart(query: Query) -> bool:
    """Whether it is proved that no path joins start and goal."""
    robot = query.world.robot
    extent, regions = _whole_extent(robot), _loose_regions(query.world)
    places = (np.array([query.start, query.goal])[:, robot.arm_index] - extent.lower) / STEP_RAD
    cells = np.clip(np.floor(places).astype(int), 0, np.array(extent.counts) - 1)
    start, goal = (_region_at(regions, cell) for cell in cells)
    return start > 0 and goal > 0 and start != goal


@lru_cache(maxsize=8)
def _loose_regions(world: World) -> Regions:
    """The regions of the cells that are not wholly blocked, kept in this process: other questions in the same world share them."""
    return free_regions(_whole_extent(world.robot).of_one_turn(wholly_blocked(world))[None])


def _whole_extent(robot: Robot) -> Extent:
    """Cells over all of the joints' ranges, the last ones beyond the limits if need be."""
    lower, upper = robot.lower[robot.arm_index], robot.upper[robot.arm_index]
    counts = np.ceil((upper - lower) / STEP_RAD - 1e-9).astype(int)
    return Extent(STEP_RAD, tuple(lower.tolist()), (0, 0, 0), tuple(counts.tolist()))


def _region_at(regions: Regions, cell: NDArray) -> int:
    """The region of a cell (3,); 0 where it is blocked."""
    here = (regions.rows[:, 1:] == cell[:2]).all(axis=1) & (regions.first <= cell[2]) & (cell[2] < regions.last)
    return int(regions.number[here][0]) if here.any() else 0


def wholly_blocked(world: World) -> NDArray:
    """Cells (n1, n2, n3), within the limits up to one turn, in all of which a link up to the carrier meets something solid."""
    robot = world.robot
    turn = round(TURN / STEP_RAD)
    first, second, third = (centres[:turn] for centres in _whole_extent(robot).centres)
    hinges, balls = hinges_of(robot, unturned(robot)), inner_balls(robot)
    planes, starts = _solids(world)
    ground = _ground(world)
    blocked = np.zeros((len(first), len(second), len(third)), bool)
    frames = np.array([hinges.T_world_first, hinges.T_first_second, hinges.T_second_third])
    share(
        lambda mine: _mark(frames, hinges.axes, balls, planes, starts, ground, first, second, third, STEP_RAD / 2, mine, blocked),
        len(first),
    )
    return blocked


def _ground(world: World) -> Ground:
    """The depth map; no column at all without one."""
    field = world.terrain
    if field is None:
        return Ground(np.empty((len(WIDE_M), 0, 0)), 1.0, np.eye(4), -np.inf)
    base, cell = float(field.T_world_range[2, 3]), float(field.cell)
    top = np.where(np.isnan(field.top), np.inf, field.top)
    top = np.where(top + base > world.table_z + TABLE_SKIN_M, top, -np.inf)
    around = [1 if not wide else 2 * int(np.ceil(wide / cell)) + 1 for wide in WIDE_M]
    tops = np.array([minimum_filter(top, size, mode="constant", cval=-np.inf) for size in around])
    return Ground(tops, cell, np.array(inverse(field.T_world_range)), float(top.max(initial=-np.inf)) + base)


def _solids(world: World) -> tuple[NDArray, NDArray]:
    """Outward planes (f, 4) of all known solids, the table and the outside among them; where each body's begin and end (b + 1,)."""
    solids = collision_model(world).solids
    faces = [faces_by_direction(solids.corners[a:b])[0] for a, b in zip(solids.first[:-1], solids.first[1:], strict=True)]
    return np.concatenate([np.empty((0, 4)), *faces]), np.cumsum([0] + [len(planes) for planes in faces])


@njit(cache=True)
def _meets_ground(ground: Ground, x: float, y: float, z: float, reach: float) -> bool:
    """Whether a ball surely holds a point of a column: its lowest point, eight amid its sides below or eight around its waist.

    With a negative `reach` [m] the centre must be as deep among columns as high.
    """
    if z - reach >= ground.highest:
        return False
    if reach <= 0.0:
        for level in range(1, len(WIDE_M)):
            if -reach <= WIDE_M[level]:
                return _below_top(ground, level, x, y, z - reach)
        return False
    if _below_top(ground, 0, x, y, z - reach):
        return True
    for down, out in ((0.7 * reach, 0.7 * reach), (0.0, reach)):
        for k in range(8):
            if _below_top(ground, 0, x + out * np.cos(k * np.pi / 4), y + out * np.sin(k * np.pi / 4), z - down):
                return True
    return False


@njit(cache=True)
def _below_top(ground: Ground, level: int, x: float, y: float, z: float) -> bool:
    """Whether a point of the world is lower than the top of its column, which is wide as `level` tells."""
    T = ground.T_range_world
    i = int(np.floor((T[0, 0] * x + T[0, 1] * y + T[0, 3]) / ground.cell))
    j = int(np.floor((T[1, 0] * x + T[1, 1] * y + T[1, 3]) / ground.cell))
    inside = 0 <= i < ground.tops.shape[2] and 0 <= j < ground.tops.shape[1]
    return inside and z + T[2, 3] < ground.tops[level, j, i]


@njit(cache=True)
def _meets(planes: NDArray, starts: NDArray, x: float, y: float, z: float, reach: float) -> bool:
    """Whether a ball surely holds a point of some body: its centre is inside all faces, or outside one alone and by less than `reach` [m]
    with its foot on that face; a negative `reach` asks that the centre be as deep inside.
    """
    for b in range(len(starts) - 1):
        most, face = -np.inf, -1
        for f in range(starts[b], starts[b + 1]):
            if most >= reach:
                break
            value = planes[f, 0] * x + planes[f, 1] * y + planes[f, 2] * z + planes[f, 3]
            if value > most:
                most, face = value, f
        if most >= reach:
            continue
        if most <= 0.0:
            return True
        u, v, w = x - most * planes[face, 0], y - most * planes[face, 1], z - most * planes[face, 2]
        inside = True
        for f in range(starts[b], starts[b + 1]):
            inside = inside and planes[f, 0] * u + planes[f, 1] * v + planes[f, 2] * w + planes[f, 3] <= 1e-9
        if inside:
            return True
    return False


@njit(cache=True, nogil=True)
def _mark(
    frames: NDArray,
    axes: NDArray,
    balls: InnerBalls,
    planes: NDArray,
    starts: NDArray,
    ground: Ground,
    first: NDArray,
    second: NDArray,
    third: NDArray,
    half: float,
    mine: NDArray,
    blocked: NDArray,
) -> None:
    """Marks the wholly blocked cells of the slices `mine` of joint 1. Where joint 3, or 2 and 3, move nothing that meets, whole rows."""
    hinge, link = np.empty((3, 4, 4)), np.empty((3, 4, 4))
    for i in mine:
        hinge[0] = frames[0]
        link[0] = turned(hinge[0], axes[0], float(first[i]))
        if _any_meets(hinge, link, axes, balls, 0, planes, starts, ground, half):
            blocked[i] = True
            continue
        for j in range(len(second)):
            hinge[1] = product(link[0], frames[1])
            link[1] = turned(hinge[1], axes[1], float(second[j]))
            if _any_meets(hinge, link, axes, balls, 1, planes, starts, ground, half):
                blocked[i, j] = True
                continue
            hinge[2] = product(link[1], frames[2])
            for m in range(len(third)):
                link[2] = turned(hinge[2], axes[2], float(third[m]))
                blocked[i, j, m] = _any_meets(hinge, link, axes, balls, 2, planes, starts, ground, half)


@njit(cache=True)
def _any_meets(
    hinge: NDArray,
    link: NDArray,
    axes: NDArray,
    balls: InnerBalls,
    stage: int,
    planes: NDArray,
    starts: NDArray,
    ground: Ground,
    half: float,
) -> bool:
    """Whether a ball that arm joint `stage` carries meets a body although each joint turns by up to `half` [rad]."""
    for s in range(len(balls.radii)):
        if balls.stage[s] != stage:
            continue
        x, y, z = _image(link[stage], balls.centres[s], 1.0)
        moved = 0.0
        for joint in range(stage, -1, -1):
            a, b, c = _image(hinge[joint], axes[joint], 0.0)
            u, v, w = x - hinge[joint, 0, 3], y - hinge[joint, 1, 3], z - hinge[joint, 2, 3]
            along = u * a + v * b + w * c
            moved += half * (np.sqrt(max(u * u + v * v + w * w - along * along, 0.0)) + moved)
        reach = balls.radii[s] - moved
        if _meets(planes, starts, x, y, z, reach) or _meets_ground(ground, x, y, z, reach):
            return True
    return False


@njit(cache=True)
def _image(T: NDArray, p: NDArray, shift: float) -> tuple[float, float, float]:
    """A point, or with `shift` 0 a direction, mapped by T."""
    return (
        T[0, 0] * p[0] + T[0, 1] * p[1] + T[0, 2] * p[2] + shift * T[0, 3],
        T[1, 0] * p[0] + T[1, 1] * p[1] + T[1, 2] * p[2] + shift * T[1, 3],
        T[2, 0] * p[0] + T[2, 1] * p[1] + T[2, 2] * p[2] + shift * T[2, 3],
    )
