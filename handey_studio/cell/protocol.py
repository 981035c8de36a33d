"""The cell: the outside world behind one small protocol. Everything that acts or senses goes through it.

A simulated cell, a recorded one and a real arm's driver all answer these calls; the task knows no more about them. All
angles are in the robot's `joint_names` order [rad], openings [m] between the fingers, times [s] from a motion's start.
Forces [N] and torques [N m] are what the outside does to the hand and to what it holds, along the world's axes and about the
hand's origin; the hand's own weight and inertia are taken out, what it carries is not: a held part shows as its weight.
"""

from dataclasses import dataclass
from typing import Literal, Protocol

from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.cell.recording import Recording
from handey_studio.motion import Trajectory
from handey_studio.sensing.depth_map import DepthMap

TOUCH_N = 5.0  # a guarded motion ends at this much more force than at its start: above what jerks a held part, far below what tips one

Ending = Literal["arrived", "contact", "blocked", "stopped"]
"""`arrived`: the motion was done. `contact`: a guarded motion felt its force, a settling its support, the fingers something between them.
`blocked`: the arm could not follow, something was in its way. `stopped`: `stop` was called."""


@dataclass(frozen=True, eq=False)
class Moved(Value):
    """How a motion ended, and all that was measured in it. The last sample is where arm and fingers are now."""

    ended: Ending
    recording: Recording

    @property
    def contact(self) -> bool:
        return self.ended == "contact"

    @property
    def q_rad(self) -> NDArray:
        """Where the arm is (joints,) [rad]."""
        return self.recording.q_rad[-1]

    @property
    def opening_m(self) -> float:
        """How far the fingers are open."""
        return float(self.recording.opening_m[-1])

    @property
    def time_s(self) -> float:
        """How long it took."""
        return float(self.recording.time_s[-1])


@dataclass(frozen=True, eq=False)
class Wrench(Value):
    """What the outside does to the hand: `force_N` (3,), `torque_Nm` (3,) about the hand's origin, along the world's axes."""

    force_N: NDArray
    torque_Nm: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "force_N", frozen_array(self.force_N))
        object.__setattr__(self, "torque_Nm", frozen_array(self.torque_Nm))


@dataclass(frozen=True)
class Compliance:
    """How a settling yields: it presses down with `force_N`, gives way to forces along x and y until less than `yield_N` is left of them,
    and moves at most `travel_m` and for at most `time_s`."""

    force_N: float = 5.0
    yield_N: float = 1.0
    travel_m: float = 0.002
    time_s: float = 0.6


class CannotAct(Exception):
    """The cell cannot do what was asked of it, told in one sentence: a recording cannot move, a motion starts elsewhere."""


class Cell(Protocol):
    """What a workcell must answer. Calls block until done. A call that cannot be served raises `CannotAct`."""

    physics: bool
    """Whether grips and placements obey forces (True) or are only geometric (False); results repeat it."""

    def scan(self) -> DepthMap:
        """One sweep of the range finder."""
        ...

    def joints(self) -> NDArray:
        """The configuration (joints,) [rad] the arm is in now, as measured."""
        ...

    def opening(self) -> float:
        """How far the fingers are open now [m], as measured."""
        ...

    def wrench(self) -> Wrench:
        """What the wrist feels now."""
        ...

    def finger_force(self) -> float:
        """With how much force [N] each finger's drive closes now, 0 when it does not press, negative when it presses outwards."""
        ...

    def follow(self, motion: Trajectory) -> Moved:
        """Move along the whole motion. It must start where the arm stands."""
        ...

    def descend(self, motion: Trajectory, until_N: float = TOUCH_N) -> Moved:
        """A guarded motion: as `follow`, but it ends in `contact` as soon as the wrist's force has changed by `until_N` since its start.

        Without touch it runs to its end and is `arrived`.
        """
        ...

    def settle(self, compliance: Compliance = Compliance()) -> Moved:
        """Press down gently and give way sideways where the arm stands, so that what the hand holds comes to lie on its support.

        `contact` when it lies there pressed as asked, `arrived` when the travel or the time was used up without.
        """
        ...

    def grip(self, opening: float, force_N: float | None = None) -> Moved:
        """Close or open the fingers towards an opening [m] with at most a force [N] each, the hand's own if None.

        `contact` when something between the fingers stops them before, `arrived` when they got there.
        """
        ...

    def stop(self) -> None:
        """Hold where the arm is. May be called from another thread while a motion runs, which then ends as `stopped`."""
        ...
