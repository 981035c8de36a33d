"""The slice configuration space of the three arm joints (Handey 1987 §4), called joints 1–3 here wherever in the chain they are.

Per slice of joint 1, and per value of joint 2 in it, the forbidden ranges of joints 2 and 3. A cell counts as free only if all of it is:
each sphere of the arm, at the cell's centre, keeps more clearance than half the cell can move it. The arm's bodies against
each other are looked at in the cells' centres only; there the path's certificate has the last word. What the links themselves meet does
not hang on the wrist and is kept for the next question.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.motion.certificate import Mover
from handey_studio.motion.certificate import mover as mover_of
from handey_studio.motion.distance_field import Field, distance_field
from handey_studio.motion.forbidden_ranges import Cells, first_ranges, second_ranges, third_ranges
from handey_studio.motion.marching import DOUBT, FREE, SOLID
from handey_studio.motion.self_collision import self_blocked
from handey_studio.motion.turning import Between, angle_table, carried_circles, hinges_of, link_circles, reach_of
from handey_studio.motion.wrist_box import WristBox, wrist_box
from handey_studio.world import Held, Robot, World
from handey_studio.world.world import EVERYWHERE, NO_TABLE

TURN = 2 * np.pi
COARSEST = float(np.deg2rad(5.1))  # cells wider than this leave too much in doubt to be worth while
REACH = 0.75 * TURN  # the way round the other side, and a quarter turn to spare


@dataclass(frozen=True)
class Extent:
    """The cells of joints 1–3: cell k of joint i, of `counts[i]`, is centred at `limits[i] + (first[i] + k + ½)·step` [rad].

    After a turn they repeat.
    """

    step: float
    limits: tuple[float, ...]
    first: tuple[int, ...]
    counts: tuple[int, ...]

    @property
    def turn(self) -> int:
        """Cells in a turn."""
        return round(TURN / self.step)

    @property
    def lower(self) -> NDArray:
        """Where the first cells begin (3,) [rad]."""
        return np.array(self.limits) + np.array(self.first) * self.step

    @property
    def centres(self) -> tuple[NDArray, ...]:
        """Centres [rad] of the cells of each joint."""
        return tuple(self.lower[i] + (np.arange(n) + 0.5) * self.step for i, n in enumerate(self.counts))

    def of_one_turn(self, cells: NDArray) -> NDArray:
        """These cells, given all from the joints' limits on up to one turn."""
        for axis, count in enumerate(self.counts):
            first = self.first[axis] % self.turn
            turns = range(0, first + count, self.turn)
            pieces = [np.moveaxis(cells, axis, 0)[max(first - turn, 0) : first + count - turn][: self.turn] for turn in turns]
            cells = np.moveaxis(pieces[0] if len(pieces) == 1 else np.concatenate(pieces), 0, axis)
        return cells


@dataclass(frozen=True, eq=False)
class ConfigurationSpace(Value):
    """The cells `blocked` (n1, n2, n3) bool of an extent; `joints` (3,) are the places of joints 1–3 in a configuration."""

    extent: Extent
    joints: NDArray
    blocked: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", frozen_array(self.joints, int))
        object.__setattr__(self, "blocked", frozen_array(self.blocked, bool))

    def place(self, q: NDArray) -> NDArray:
        """Where q (n,) is (3,), counted in cells from the first one's centre."""
        return (np.asarray(q)[self.joints] - self.extent.lower) / self.extent.step - 0.5

    def cell(self, q: NDArray) -> tuple[int, int, int]:
        """The cell that holds the arm joints of q; the nearest one when it lies beyond the last."""
        i, j, m = np.clip(np.round(self.place(q)).astype(int), 0, np.array(self.extent.counts) - 1)
        return int(i), int(j), int(m)

    def centre(self, cells: NDArray) -> NDArray:
        """Angles (..., 3) [rad] of cells (..., 3)."""
        return self.extent.lower + (np.asarray(cells) + 0.5) * self.extent.step

    def at(self, cell: NDArray, q: NDArray) -> NDArray:
        """The configuration q (n,) with its arm joints in the centre of a cell."""
        out = np.array(q, dtype=float)
        out[self.joints] = self.centre(cell)
        return out


def extent_around(robot: Robot, step: float, around: NDArray | None = None) -> Extent:
    """The cells, `step` [rad] wide, which must divide a turn, within the arm joints' limits.

    No farther than `REACH` from configurations `around` (m, joints) [rad] when they are given: beyond that it is the same arm a turn on.
    """
    arm = robot.arm_index
    lower, upper, first = robot.lower[arm], robot.upper[arm], np.zeros(3, int)
    if around is not None:
        first = np.floor(np.maximum(around[:, arm].min(axis=0) - REACH - lower, 0.0) / step).astype(int)
        upper = np.minimum(upper, around[:, arm].max(axis=0) + REACH)
    counts = np.maximum(np.floor((upper - lower) / step + 1e-9).astype(int) - first, 1)
    return Extent(step, tuple(lower.tolist()), tuple(first.tolist()), tuple(counts.tolist()))


def configuration_space(mover: Mover, wrists: NDArray, extent: Extent) -> tuple[ConfigurationSpace, WristBox]:
    """The space of a mover's arm while its other joints run through `wrists` (m, joints − 3) [rad], and the wrist box.

    Where the arm's own bodies are compared the other joints are as in the middle of their way.
    """
    world = mover.model.world
    carried = Carried(world.robot, mover.margin, mover.opening, mover.held, tuple(tuple(posture) for posture in wrists.tolist()))
    met = np.repeat(_own_cells(carried, extent.step).astype(np.int8)[:, None], len(_values(world.robot, extent.step)[0]), axis=1)
    for obstacles in obstacles_apart(world):
        met |= _scene_cells(obstacles, carried, extent.step).states
    return ConfigurationSpace(extent, world.robot.arm_index, extent.of_one_turn((met != FREE).swapaxes(0, 1))), _box(carried)


@dataclass(frozen=True)
class Obstacles:
    """What is looked at by itself: a world. Where it stands `among` others whose cells are known, nothing is asked that these settle, and
    of the world only what is in it counts: the table and the outside belong to the others.
    """

    world: World
    among: "Obstacles | None" = None

    def field(self, reach: float) -> Field:
        """The distances to them, as far as the arm may reach [m]."""
        field = distance_field(self.world, reach)
        return field._replace(table_z=NO_TABLE, free=np.array(EVERYWHERE)) if self.among else field


def obstacles_apart(world: World) -> list[Obstacles]:
    """The world in pieces that are free where all of them are: the table and the outside, all else that stays, and each part by itself.

    When a part moves, the cells of all the others are kept, and at a new depth map those of the table.
    """
    robot = world.robot
    bare = Obstacles(World(robot, world.table_z, free_space=world.free_space))
    stays = Obstacles(replace(world, parts=()), bare)
    return [stays, *(Obstacles(World(robot, NO_TABLE, parts=(placed,), free_space=EVERYWHERE), stays) for placed in world.parts)]


@dataclass(frozen=True)
class Carried:
    """What a space hangs on besides the scene: the robot, the margin [m], and what the wrist carries along its way."""

    robot: Robot
    margin: float
    opening: float
    held: Held | None
    way: tuple[tuple[float, ...], ...]


@lru_cache(maxsize=64)
def _box(carried: Carried) -> WristBox:
    return wrist_box(carried.robot, np.array(carried.way), carried.opening, carried.held)


@lru_cache(maxsize=64)
def _scene_cells(obstacles: Obstacles, carried: Carried, step: float) -> Cells:
    """What the cells, all within the limits up to one turn, are with regard to obstacles and what they are among; kept in this process.

    Only those are looked at which the cells of twice their width, up to `COARSEST`, leave in doubt.
    """
    robot, box, values = carried.robot, _box(carried), _values(carried.robot, step)
    held, reach = Between.of(robot, box.wrists), reach_of(robot, box)
    links = _link_cells(obstacles, carried.margin, step, held, reach)
    known = links.cells.states
    if obstacles.among:
        known = np.maximum(known, _scene_cells(obstacles.among, carried, step).states)
    wider = None if _coarsest(step) else _scene_cells(obstacles, carried, 2 * step)
    field, circles = obstacles.field(reach), carried_circles(robot, box, carried.margin, held, step)
    return third_ranges(field, hinges_of(robot, held), circles, values[:2], angle_table(values[2]), step, links.own, wider, known)


class Links(NamedTuple):
    """What links up to the carrier meet: `own` (n1, n2), rows as obstacles leave them, FREE where those that they are among settle it; the
    same `rows` as all of them leave them; and `cells`. Up to one turn each.
    """

    own: NDArray
    rows: NDArray
    cells: Cells


@lru_cache(maxsize=32)
def _link_cells(obstacles: Obstacles, margin: float, step: float, held: Between, reach: float) -> Links:
    robot, coarsest = obstacles.world.robot, _coarsest(step)
    values = _values(robot, step)
    hinges, turns, field = hinges_of(robot, held), [angle_table(angles) for angles in values], obstacles.field(reach)
    circles = [link_circles(robot, stage, margin, held, step) for stage in range(3)]
    among = _link_cells(obstacles.among, margin, step, held, reach) if obstacles.among else None
    wider = None if coarsest else _link_cells(obstacles, margin, 2 * step, held, reach)
    first, own = np.full(len(values[0]), DOUBT, np.int8), np.full((len(values[0]), len(values[1])), DOUBT, np.int8)
    if wider:
        own = _halved(wider.own, *own.shape, beyond=DOUBT)
    if among:
        own[among.rows == SOLID if coarsest else among.rows != FREE] = FREE  # which asks nothing
    first_ranges(field, hinges, circles[0], turns[0], step, coarsest, first)
    second_ranges(field, hinges, circles[1], values[0], turns[1], step, coarsest, first, own)
    rows, known = (np.maximum(own, among.rows), among.cells.states) if among else (own, None)
    return Links(own, rows, third_ranges(field, hinges, circles[2], values[:2], turns[2], step, own, wider and wider.cells, known))


def _halved(wider: NDArray, first: int, second: int, beyond: int) -> NDArray:
    """Cells (first, second) of half the width, as the wider ones have them; those `beyond` these are that."""
    cells = np.full((first, second), beyond, wider.dtype)
    inside = wider.repeat(2, axis=0).repeat(2, axis=1)[:first, :second]
    cells[: inside.shape[0], : inside.shape[1]] = inside
    return cells


@lru_cache(maxsize=32)
def _own_cells(carried: Carried, step: float) -> NDArray:
    """Cells (n2, n3) in which the arm meets itself, seen at the centres of the coarsest cells."""
    values = _values(carried.robot, step)
    if not _coarsest(step):
        return _halved(_own_cells(carried, 2 * step), len(values[1]), len(values[2]), beyond=True)
    way = np.array(carried.way)
    middle = way[len(way) // 2] if len(way) > 2 else way.mean(axis=0)
    mine = mover_of(World(carried.robot), carried.opening, carried.held, (), carried.margin)
    return self_blocked(mine, values[1], values[2], middle)


def _coarsest(step: float) -> bool:
    """Whether there are no cells of twice that width."""
    return 2 * step > COARSEST


def _values(robot: Robot, step: float) -> tuple[NDArray, NDArray, NDArray]:
    """Centres [rad] of all cells within the limits, up to one turn."""
    extent = extent_around(robot, step)
    first, second, third = (centres[: extent.turn] for centres in extent.centres)
    return first, second, third
