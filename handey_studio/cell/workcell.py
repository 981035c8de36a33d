"""A workcell as data: the robot, what is known to stand around it, and the cell that answers for the outside world."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.cell.faults import Fault
from handey_studio.sensing.stripes.range_finder import RangeFinder
from handey_studio.world.world import DEFAULT_FREE_SPACE, Block


@dataclass(frozen=True, eq=False)
class TrueBody(Value):
    """A body of the simulated world, known to the simulated cell alone.

    Either `part` names a part of the library, or `size` (3,) [m] makes it a cuboid that no model describes.
    """

    name: str
    T_world_body: NDArray
    part: str | None = None
    size: NDArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_body", frozen_array(self.T_world_body))
        if self.size is not None:
            object.__setattr__(self, "size", frozen_array(self.size))


@dataclass(frozen=True, eq=False)
class SimulatedSetup(Value):
    """The hidden truth of a simulated cell. With `drop`, the bodies fall from their poses until they rest; `seed` drives the noise.

    With `physics` everything obeys forces, else the arm is followed exactly and grips are geometric. `faults` go wrong on purpose. The
    range finder really stands at `T_range_offset @ T_world_range`, which nobody knows before it is calibrated. The body called `held` is
    in the closed hand at the start, where the arm stands at home.
    """

    bodies: tuple[TrueBody, ...] = ()
    drop: bool = False
    seed: int = 0
    physics: bool = True
    faults: tuple[Fault, ...] = ()
    T_range_offset: NDArray = field(default_factory=lambda: np.eye(4))
    held: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_range_offset", frozen_array(self.T_range_offset))


@dataclass(frozen=True, eq=False)
class Workcell(Value):
    """`robot` and `parts` name what the library knows; `blocks` stand fixed; `free_space` (2, 3) [m] is declared free."""

    robot: str = "ur5"
    parts: tuple[str, ...] = ()
    blocks: tuple[Block, ...] = ()
    free_space: NDArray = field(default_factory=lambda: DEFAULT_FREE_SPACE)
    table_z: float = 0.0
    finder: RangeFinder = field(default_factory=RangeFinder)
    setup: SimulatedSetup = field(default_factory=SimulatedSetup)

    def __post_init__(self) -> None:
        object.__setattr__(self, "free_space", frozen_array(self.free_space))
        if self.free_space.shape != (2, 3) or not (self.free_space[0] < self.free_space[1]).all() or not np.isfinite(self.free_space).all():
            raise ValueError("free_space must be a lower and an upper corner in metres.")
