"""The proof that there is no path: start and goal stay apart although nothing but wholly blocked cells is taken out.

A cell is wholly blocked when a ball inside a link up to the wrist's carrier surely meets something solid at every configuration of the
cell. What the wrist carries, the depth map and the arm itself are passed over: no way is refused that might be there.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.motion.configuration_space import TURN, Extent
from handey_studio.motion.cores import share
from handey_studio.motion.distance_field import faces_by_direction
from handey_studio.motion.forbidden_ranges import product, turned
from handey_studio.motion.query import Query
from handey_studio.motion.regions import Regions, free_regions
from handey_studio.motion.turning import Between, hinges_of
from handey_studio.motion.wrist_box import balls_around
from handey_studio.world import Robot, World
from handey_studio.world.collision import collision_model
from handey_studio.world.collision_bodies import robot_pieces

STEP_RAD = float(np.deg2rad(2.5))
DIE_M = 0.06
LEAST_M = 0.02  # smaller balls prove next to nothing


class InnerBalls(NamedTuple):
    """Balls inside the links: centres (k, 3) [m] in the frame of the link that arm joint `stage` (k,) carries, radii (k,) [m]."""

    centres: NDArray
    radii: NDArray
    stage: NDArray


def surely_apart(query: Query) -> bool:
    """Whether it is proved that no path joins start and goal. Never for arms that hold a joint before the wrist's carrier."""
    robot = query.world.robot
    if (robot.held_index < robot.carrier).any():
        return False
    extent = _whole_extent(robot)
    blocked = extent.of_one_turn(wholly_blocked(query.world))
    regions = free_regions(blocked[None])
    places = (np.array([query.start, query.goal])[:, robot.arm_index] - extent.lower) / STEP_RAD
    cells = np.clip(np.floor(places).astype(int), 0, np.array(extent.counts) - 1)
    start, goal = (_region_at(regions, cell) for cell in cells)
    return start > 0 and goal > 0 and start != goal


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
    """Cells (n1, n2, n3), within the limits up to one turn, in all of which a link up to the carrier meets something known and solid."""
    robot = world.robot
    turn = round(TURN / STEP_RAD)
    first, second, third = (centres[:turn] for centres in _whole_extent(robot).centres)
    hinges, balls = hinges_of(robot, Between((), ())), inner_balls(robot)
    planes, starts = _solids(world)
    blocked = np.zeros((len(first), len(second), len(third)), bool)
    frames = np.array([hinges.T_world_first, hinges.T_first_second, hinges.T_second_third])
    share(lambda mine: _mark(frames, hinges.axes, balls, planes, starts, first, second, third, STEP_RAD / 2, mine, blocked), len(first))
    return blocked


def inner_balls(robot: Robot) -> InnerBalls:
    """Balls inside the links from the first arm joint's to the carrier."""
    centres, radii, stages = [], [], []
    for piece in robot_pieces(robot):
        stage = int(np.searchsorted(robot.arm_index, piece.link)) - 1
        if stage < 0 or piece.link > robot.carrier:
            continue
        planes, _ = faces_by_direction(piece.corners)
        for centre in balls_around(piece.corners, DIE_M)[0]:
            depth = -float((planes[:, :3] @ centre + planes[:, 3]).max())
            if depth > LEAST_M:
                centres.append(centre)
                radii.append(depth)
                stages.append(stage)
    return InnerBalls(np.array(centres).reshape(-1, 3), np.array(radii, float), np.array(stages, np.int64))


def _solids(world: World) -> tuple[NDArray, NDArray]:
    """Outward planes (f, 4) of all known solids, the table and the outside among them; where each body's begin and end (b + 1,)."""
    solids = collision_model(world).solids
    faces = [faces_by_direction(solids.corners[a:b])[0] for a, b in zip(solids.first[:-1], solids.first[1:], strict=True)]
    return np.concatenate([np.empty((0, 4)), *faces]), np.cumsum([0] + [len(planes) for planes in faces])


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
        if _any_meets(hinge, link, axes, balls, 0, planes, starts, half):
            blocked[i] = True
            continue
        for j in range(len(second)):
            hinge[1] = product(link[0], frames[1])
            link[1] = turned(hinge[1], axes[1], float(second[j]))
            if _any_meets(hinge, link, axes, balls, 1, planes, starts, half):
                blocked[i, j] = True
                continue
            hinge[2] = product(link[1], frames[2])
            for m in range(len(third)):
                link[2] = turned(hinge[2], axes[2], float(third[m]))
                blocked[i, j, m] = _any_meets(hinge, link, axes, balls, 2, planes, starts, half)


@njit(cache=True)
def _any_meets(
    hinge: NDArray, link: NDArray, axes: NDArray, balls: InnerBalls, stage: int, planes: NDArray, starts: NDArray, half: float
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
        if _meets(planes, starts, x, y, z, balls.radii[s] - moved):
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
