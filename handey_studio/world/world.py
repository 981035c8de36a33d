"""The world: what the planner believes about the workcell. Nothing here knows how the world really is."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.geometry import HeightField
from handey_studio.world.part import PlacedPart
from handey_studio.world.robot import Robot


@dataclass(frozen=True, eq=False)
class Block(Value):
    """A known fixed cuboid of the workcell: its full size (3,) [m] about the origin of its pose."""

    name: str
    size: NDArray
    T_world_block: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", frozen_array(self.size))
        object.__setattr__(self, "T_world_block", frozen_array(self.T_world_block))

    @property
    def corners_world(self) -> NDArray:
        """Corners (8, 3) [m]."""
        half = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * self.size
        return half @ self.T_world_block[:3, :3].T + self.T_world_block[:3, 3]


@dataclass(frozen=True, eq=False)
class ConvexBody(Value):
    """A known fixed convex body of the workcell: the hull of its corners (k, 3) [m] in the world."""

    name: str
    corners_world: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners_world", frozen_array(self.corners_world))


DEFAULT_FREE_SPACE = frozen_array([[-1.2, -1.2, -0.2], [1.2, 1.2, 1.6]])
EVERYWHERE = frozen_array([[-np.inf] * 3, [np.inf] * 3])
NO_TABLE = -np.inf


@dataclass(frozen=True, eq=False)
class World(Value):
    """The robot, the table (solid below `table_z`), known blocks, located parts, and the depth map as solid columns.

    `free_space` (2, 3) [m] are the lower and upper corner of the space that the workcell declares free wherever nothing
    was scanned; everything outside it is solid, and called `outside`. A workcell that declares all space free says `EVERYWHERE`, and
    `table_z` is `NO_TABLE` where there is none; a depth map needs a table and a bounded space.
    Bodies are called `table`, `depth map`, the names of blocks and part instances, the links' names and
    `finger_left`, `finger_right`, `crosspiece`, `mount`.
    """

    robot: Robot
    table_z: float = 0.0
    blocks: tuple[Block | ConvexBody, ...] = ()
    parts: tuple[PlacedPart, ...] = ()
    terrain: HeightField | None = None
    free_space: NDArray = field(default_factory=lambda: DEFAULT_FREE_SPACE)

    def __post_init__(self) -> None:
        if self.terrain is not None and not (np.isfinite(self.table_z) and np.isfinite(self.free_space).all()):
            raise ValueError("a depth map needs a table below it and a bounded free space around it.")

    def part(self, name: str) -> PlacedPart:
        """The located instance of that name."""
        return next(placed for placed in self.parts if placed.name == name)

    def without(self, name: str) -> "World":
        """The world with one instance taken out, as when it is in the hand."""
        return replace(self, parts=tuple(placed for placed in self.parts if placed.name != name))

    def with_part(self, placed: PlacedPart) -> "World":
        """The world with one instance put in, in place of one of the same name."""
        return replace(self, parts=(*self.without(placed.name).parts, placed))
