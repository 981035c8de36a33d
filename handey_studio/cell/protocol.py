"""The cell: the outside world behind one small protocol. Everything that acts or senses goes through it.

A simulated cell, a recorded one and a real arm's driver all answer these calls; the task knows no more about them. All
angles are in the robot's `joint_names` order [rad], openings [m] between the fingers, times [s] from a motion's start.
"""

from dataclasses import dataclass
from typing import Protocol

from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.motion import Trajectory
from handey_studio.sensing.depth_map import DepthMap


@dataclass(frozen=True, eq=False)
class Moved(Value):
    """How a motion ended: at `q_rad` (joints,), `time_s` after its start; `contact` when touch stopped a guarded one."""

    q_rad: NDArray
    time_s: float
    contact: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "q_rad", frozen_array(self.q_rad))


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
        """The configuration (joints,) [rad] the arm is in now."""
        ...

    def opening(self) -> float:
        """How far the fingers are open now [m]."""
        ...

    def follow(self, motion: Trajectory) -> Moved:
        """Move along the whole motion. It must start where the arm stands."""
        ...

    def descend(self, motion: Trajectory) -> Moved:
        """A guarded motion: as `follow`, but it ends where what the hand carries, or the bare hand, first touches something.

        Without touch it runs to its end and reports `contact` False.
        """
        ...

    def grip(self, opening: float) -> float:
        """Close or open the fingers towards an opening [m]; the opening reached, which is wider when something is between them."""
        ...

    def contact(self) -> bool:
        """Whether the fingers press on something now."""
        ...
