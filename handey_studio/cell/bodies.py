"""True bodies: what really stands in the simulated cell. No planner imports this."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.cell.workcell import TrueBody, Workcell
from handey_studio.geometry import Polyhedron, box, convex_pieces
from handey_studio.geometry.transforms import apply, is_rigid
from handey_studio.world.part import Part

BLOCK_DENSITY = 700.0  # kg/m³, wood, as the parts
BLOCK_FRICTION = 0.5
FAR_M = 1.5  # half side of the table that the cell simulates; beyond it nothing is scanned or dropped


@dataclass(frozen=True, eq=False)
class SolidBody(Value):
    """A rigid body with exact faces. `fixed` bodies belong to the cell and never move."""

    name: str
    solid: Polyhedron
    T_world_body: NDArray
    density: float = BLOCK_DENSITY
    friction: float = BLOCK_FRICTION
    fixed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_body", frozen_array(self.T_world_body))
        if not is_rigid(self.T_world_body):
            raise BadInput(f'the pose of body "{self.name}" is not a rigid 4×4 transform.')

    @cached_property
    def pieces(self) -> tuple[NDArray, ...]:
        """Exact convex pieces, corners (k, 3) [m] in the body's frame."""
        return convex_pieces(self.solid)

    @property
    def corners_world(self) -> NDArray:
        """Corners (n, 3) [m]."""
        return apply(self.T_world_body, self.solid.vertices)

    def at(self, T_world_body: NDArray) -> "SolidBody":
        """The same body elsewhere; its pieces are kept."""
        moved = replace(self, T_world_body=T_world_body)
        moved.__dict__["pieces"] = self.pieces
        return moved


def solid_body(body: TrueBody, part_of: Callable[[str], Part]) -> SolidBody:
    """The geometry of a true body; `part_of` gives the library's part of a name."""
    if body.part is not None:
        part = part_of(body.part)
        return SolidBody(body.name, part.solid, body.T_world_body, part.density, part.friction)
    if body.size is None or len(body.size) != 3 or not (body.size > 0).all():
        raise BadInput(f'true body "{body.name}" names no part and has no size (x, y, z) above 0 m; give one of them.')
    return SolidBody(body.name, box(body.size), body.T_world_body)


def fixed_bodies(workcell: Workcell) -> tuple[SolidBody, ...]:
    """The table, as a slab a quarter of a metre thick, and the workcell's known blocks."""
    T = np.eye(4)
    T[2, 3] = workcell.table_z - 0.125
    table = SolidBody("table", box((2 * FAR_M, 2 * FAR_M, 0.25)), T, fixed=True)
    blocks = (SolidBody(block.name, box(block.size), block.T_world_block, fixed=True) for block in workcell.blocks)
    return (table, *blocks)


def check_names(bodies: Iterable[SolidBody]) -> None:
    """BadInput when two bodies share a name."""
    seen: set[str] = set()
    for body in bodies:
        if body.name in seen:
            raise BadInput(f'two bodies of the cell are called "{body.name}"; every name must be its own.')
        seen.add(body.name)
