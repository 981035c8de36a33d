"""The slice configuration space of the three arm joints (Handey 1987 §4), called joints 1–3 here wherever in the chain they are.

Per slice of joint 1, and per value of joint 2 in it, the forbidden ranges of joints 2 and 3. A cell counts as free only if all of it is:
each sphere of the arm, at the cell's centre, keeps more clearance than half the cell can move it. The arm's bodies against
each other are looked at in the cells' centres only; there the path's certificate has the last word. What the links themselves meet does
not hang on the wrist and is kept for the next question.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.motion.certificate import Mover
from handey_studio.motion.certificate import mover as mover_of
from handey_studio.motion.distance_field import distance_field
from handey_studio.motion.forbidden_ranges import first_ranges, second_ranges, third_ranges
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
        for axis in (2, 1, 0):
            cells = cells.take((self.first[axis] + np.arange(self.counts[axis])) % self.turn, axis=axis)
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
    blocked = np.repeat(_own_cells(carried, extent.step)[None], len(_values(world.robot, extent.step)[0]), axis=0)
    for obstacles in obstacles_apart(world):
        blocked |= _scene_cells(obstacles, carried, extent.step) != FREE
    return ConfigurationSpace(extent, world.robot.arm_index, extent.of_one_turn(blocked)), _box(carried)


@dataclass(frozen=True)
class Obstacles:
    """What is looked at by itself: a world. Where it stands `among` others whose cells are known, nothing is asked that these settle."""

    world: World
    among: "Obstacles | None" = None


def obstacles_apart(world: World) -> list[Obstacles]:
    """The world in pieces that are free where all of them are: all that stays where it is, and each part by itself.

    When a part moves, the cells of all the others are kept.
    """
    stays = Obstacles(replace(world, parts=()))
    alone = [World(world.robot, NO_TABLE, parts=(placed,), free_space=EVERYWHERE) for placed in world.parts]
    return [stays, *(Obstacles(one, stays) for one in alone)]


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
def _scene_cells(obstacles: Obstacles, carried: Carried, step: float) -> NDArray:
    """What the cells (n1, n2, n3), all within the limits up to one turn, are with regard to obstacles; kept in this process.

    Only those are looked at which the cells of twice their width, up to `COARSEST`, leave in doubt.
    """
    robot, box, values = carried.robot, _box(carried), _values(carried.robot, step)
    held, reach = Between.of(robot, box.wrists), reach_of(robot, box)
    rows, links = _link_cells(obstacles, carried.margin, step, held, reach)
    known = np.maximum(links, _scene_cells(obstacles.among, carried, step)) if obstacles.among else links
    coarse = None if _coarsest(step) else _scene_cells(obstacles, carried, 2 * step)
    field, circles = distance_field(obstacles.world, reach), carried_circles(robot, box, carried.margin, held, step)
    places = (values[0], values[1])
    return third_ranges(field, hinges_of(robot, held), circles, places, angle_table(values[2]), step, rows, coarse, known, links)


@lru_cache(maxsize=32)
def _link_cells(obstacles: Obstacles, margin: float, step: float, held: Between, reach: float) -> tuple[NDArray, NDArray]:
    """What links up to the carrier meet: rows (n1, n2) as those before it leave them, and cells (n1, n2, n3), up to one turn each."""
    robot, coarsest = obstacles.world.robot, _coarsest(step)
    values = _values(robot, step)
    hinges, turns, field = hinges_of(robot, held), [angle_table(angles) for angles in values], distance_field(obstacles.world, reach)
    circles = [link_circles(robot, stage, margin, held, step) for stage in range(3)]
    known_rows, known = _link_cells(obstacles.among, margin, step, held, reach) if obstacles.among else (None, None)
    first, rows = np.full(len(values[0]), DOUBT, np.int8), np.full((len(values[0]), len(values[1])), DOUBT, np.int8)
    if known_rows is not None:
        rows[known_rows == SOLID if coarsest else known_rows != FREE] = FREE  # which asks nothing
    first_ranges(field, hinges, circles[0], turns[0], step, coarsest, first)
    second_ranges(field, hinges, circles[1], values[0], turns[1], step, coarsest, first, rows)
    coarse = None if coarsest else _link_cells(obstacles, margin, 2 * step, held, reach)[1]
    places = (values[0], values[1])
    return rows, third_ranges(field, hinges, circles[2], places, turns[2], step, rows, coarse, known, None)


@lru_cache(maxsize=32)
def _own_cells(carried: Carried, step: float) -> NDArray:
    """Cells (n2, n3) in which the arm meets itself, seen at the centres of the coarsest cells."""
    values = _values(carried.robot, step)
    if not _coarsest(step):
        wide = _own_cells(carried, 2 * step).repeat(2, axis=0).repeat(2, axis=1)[: len(values[1]), : len(values[2])]
        return np.pad(wide, [(0, len(values[1]) - wide.shape[0]), (0, len(values[2]) - wide.shape[1])], constant_values=True)
    way = np.array(carried.way)
    middle = way[len(way) // 2] if len(way) > 2 else way.mean(axis=0)
    mine = mover_of(World(carried.robot), carried.opening, carried.held, (), carried.margin)
    return self_blocked(mine, values[1], values[2], middle)


def _coarsest(step: float) -> bool:
    """Whether there are no cells of twice that width."""
    return 2 * step > COARSEST


def _values(robot: Robot, step: float) -> tuple[NDArray, ...]:
    """Centres [rad] of all cells within the limits, up to one turn."""
    extent = extent_around(robot, step)
    return tuple(centres[: extent.turn] for centres in extent.centres)
