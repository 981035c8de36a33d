"""The slice configuration space of the three arm joints (Handey 1987 §4), called joints 1–3 here wherever in the chain they are.

Per slice of joint 1, and per value of joint 2 in it, the forbidden ranges of joints 2 and 3. A cell counts as free only if all of it is:
each sphere of the arm, at the cell's centre, keeps more clearance than half the cell can move it. The arm's bodies against
each other are looked at in the cells' centres only; there the path's certificate has the last word. What the links themselves meet does
not hang on the wrist and is kept for the next question.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.motion.certificate import Mover
from handey_studio.motion.certificate import mover as mover_of
from handey_studio.motion.distance_field import distance_field
from handey_studio.motion.forbidden_ranges import first_ranges, second_ranges, third_ranges
from handey_studio.motion.self_collision import self_blocked
from handey_studio.motion.turning import Between, angle_table, carried_circles, hinges_of, link_circles, reach_of
from handey_studio.motion.wrist_box import WristBox, wrist_box
from handey_studio.world import Held, Robot, World

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
        return cells[np.ix_(*((first + np.arange(n)) % self.turn for first, n in zip(self.first, self.counts, strict=True)))]


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
    robot = mover.model.world.robot
    way = tuple(tuple(posture) for posture in wrists.tolist())
    carried = Carried(mover.model.world, mover.margin, mover.opening, mover.held, way)
    blocked = _scene_cells(carried, extent.step) | _own_cells(carried, extent.step)[None]
    return ConfigurationSpace(extent, robot.arm_index, extent.of_one_turn(blocked)), _box(carried)


@dataclass(frozen=True)
class Carried:
    """What a space hangs on: the world, the margin [m], and what the wrist carries along its way."""

    world: World
    margin: float
    opening: float
    held: Held | None
    way: tuple[tuple[float, ...], ...]


@lru_cache(maxsize=64)
def _box(carried: Carried) -> WristBox:
    return wrist_box(carried.world.robot, np.array(carried.way), carried.opening, carried.held)


@lru_cache(maxsize=16)
def _scene_cells(carried: Carried, step: float) -> NDArray:
    """Cells (n1, n2, n3), all within the limits up to one turn, that the scene does not leave wholly free; kept in this process.

    Only those are looked at which the cells of twice their width, up to `COARSEST`, leave in doubt.
    """
    world, box = carried.world, _box(carried)
    robot, values = world.robot, _values(world.robot, step)
    held, reach = Between.of(robot, box.wrists), reach_of(robot, box)
    rows, links = _link_cells(world, carried.margin, step, held, reach)
    doubt = _doubt(_scene_cells(carried, 2 * step) if 2 * step < COARSEST else None, links.shape)
    blocked, turns = links.copy(), angle_table(values[2])
    circles = carried_circles(robot, box, carried.margin, held, step)
    third_ranges(distance_field(world, reach), hinges_of(robot, held), circles, (values[0], values[1]), turns, step, rows, doubt, blocked)
    return blocked


@lru_cache(maxsize=8)
def _link_cells(world: World, margin: float, step: float, held: Between, reach: float) -> tuple[NDArray, NDArray]:
    """What links up to the carrier meet: rows (n1, n2) forbidden by those before it, and cells (n1, n2, n3), up to one turn each."""
    robot, values = world.robot, _values(world.robot, step)
    hinges, turns, field = hinges_of(robot, held), [angle_table(angles) for angles in values], distance_field(world, reach)
    first, second, third = (link_circles(robot, stage, margin, held, step) for stage in range(3))
    rows = second_ranges(field, hinges, second, values[0], turns[1], step, first_ranges(field, hinges, first, turns[0], step))
    blocked = np.zeros((len(values[0]), len(values[1]), len(values[2])), bool)
    blocked[rows] = True
    doubt = _doubt(_link_cells(world, margin, 2 * step, held, reach)[1] if 2 * step < COARSEST else None, blocked.shape)
    third_ranges(field, hinges, third, (values[0], values[1]), turns[2], step, rows, doubt, blocked)
    return rows, blocked


@lru_cache(maxsize=32)
def _own_cells(carried: Carried, step: float) -> NDArray:
    """Cells (n2, n3) in which the arm meets itself, seen at the centres of the coarsest cells."""
    robot = carried.world.robot
    values = _values(robot, step)
    if 2 * step < COARSEST:
        return _doubt(_own_cells(carried, 2 * step), (len(values[1]), len(values[2])))
    way = np.array(carried.way)
    middle = way[len(way) // 2] if len(way) > 2 else way.mean(axis=0)
    mine = mover_of(carried.world, carried.opening, carried.held, (), carried.margin)
    return self_blocked(mine, values[1], values[2], middle)


def _values(robot: Robot, step: float) -> tuple[NDArray, ...]:
    """Centres [rad] of all cells within the limits, up to one turn."""
    extent = extent_around(robot, step)
    return tuple(centres[: extent.turn] for centres in extent.centres)


def _doubt(coarse: NDArray | None, shape: tuple[int, ...]) -> NDArray:
    """Cells that are not known to be free from blocked cells of twice their width; all, if there are none."""
    doubt = np.ones(shape, bool)
    if coarse is not None:
        for axis in range(coarse.ndim):
            coarse = coarse.repeat(2, axis=axis)
        inside = tuple(slice(min(a, b)) for a, b in zip(shape, coarse.shape, strict=True))
        doubt[inside] = coarse[inside]
    return doubt
