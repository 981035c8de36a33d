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
from handey_studio.motion.distance_field import distance_field
from handey_studio.motion.forbidden_ranges import first_ranges, second_ranges, third_ranges
from handey_studio.motion.self_collision import self_blocked
from handey_studio.motion.turning import Between, angle_table, carried_circles, hinges_of, link_circles, reach_of
from handey_studio.motion.wrist_box import WristBox
from handey_studio.world import Robot, World

TURN = 2 * np.pi
REACH = 0.75 * TURN  # the way round the other side, and a quarter turn to spare


@dataclass(frozen=True)
class Extent:
    """The cells of joints 1–3: cell k of joint i, of `counts[i]`, is centred at `lower[i] + (k + ½)·step` [rad].

    After a turn they repeat.
    """

    step: float
    lower: tuple[float, ...]
    counts: tuple[int, ...]

    @property
    def turn(self) -> int:
        """Cells in a turn."""
        return round(TURN / self.step)

    @property
    def centres(self) -> tuple[NDArray, ...]:
        """Centres [rad] of the cells of each joint."""
        return tuple(self.lower[i] + (np.arange(n) + 0.5) * self.step for i, n in enumerate(self.counts))

    @property
    def once(self) -> tuple[NDArray, ...]:
        """The same, up to one turn."""
        return tuple(centres[: self.turn] for centres in self.centres)


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
        return np.array(self.extent.lower) + (np.asarray(cells) + 0.5) * self.extent.step

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
    lower, upper = robot.lower[arm], robot.upper[arm]
    if around is not None:
        lower = lower + step * np.floor(np.maximum(around[:, arm].min(axis=0) - REACH - lower, 0.0) / step)
        upper = np.minimum(upper, around[:, arm].max(axis=0) + REACH)
    counts = np.maximum(np.floor((upper - lower) / step + 1e-9).astype(int), 1)
    return Extent(step, tuple(lower.tolist()), tuple(counts.tolist()))


def configuration_space(mover: Mover, box: WristBox, extent: Extent) -> ConfigurationSpace:
    """The space of a mover's arm whose wrist is enclosed by a box.

    Where the arm's own bodies are compared the other joints are as in the middle of the box's way.
    """
    world, wrists, once = mover.model.world, box.wrists, extent.once
    robot = world.robot
    held = Between.of(robot, wrists)
    reach = reach_of(robot, box)
    rows, links = _link_ranges(world, mover.margin, extent, held, reach)
    blocked = links.copy()
    carried = carried_circles(robot, box, mover.margin, held, extent.step)
    turns = angle_table(once[2])
    third_ranges(distance_field(world, reach), hinges_of(robot, held), carried, (once[0], once[1]), turns, extent.step, rows, blocked)
    middle = wrists[len(wrists) // 2] if len(wrists) > 2 else wrists.mean(axis=0)
    blocked |= self_blocked(mover, once[1], once[2], middle)[None]
    if max(extent.counts) > extent.turn:
        blocked = blocked[np.ix_(*(np.arange(n) % extent.turn for n in extent.counts))]
    return ConfigurationSpace(extent, robot.arm_index, blocked)


@lru_cache(maxsize=8)
def _link_ranges(world: World, margin: float, extent: Extent, held: Between, reach: float) -> tuple[NDArray, NDArray]:
    """What links up to the carrier meet: rows (n1, n2) forbidden by those before it, and cells (n1, n2, n3), up to one turn each."""
    robot, once, step = world.robot, extent.once, extent.step
    hinges, turns, field = hinges_of(robot, held), [angle_table(values) for values in once], distance_field(world, reach)
    first, second, third = (link_circles(robot, stage, margin, held, step) for stage in range(3))
    rows = second_ranges(field, hinges, second, once[0], turns[1], step, first_ranges(field, hinges, first, turns[0], step))
    blocked = np.zeros((len(once[0]), len(once[1]), len(once[2])), bool)
    blocked[rows] = True
    third_ranges(field, hinges, third, (once[0], once[1]), turns[2], step, rows, blocked)
    return rows, blocked
