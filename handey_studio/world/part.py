"""Parts: what the user modelled and wants moved."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.geometry import Polyhedron, convex_pieces, symmetries


@dataclass(frozen=True, eq=False)
class Mate(Value):
    """A mating pose: where `part` stands when it fits onto the part that names this mate. `T_this_part` (4, 4) maps the one
    to the other's frame."""

    part: str
    T_this_part: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_this_part", frozen_array(self.T_this_part))


@dataclass(frozen=True)
class Provenance:
    """Where a model came from. `source` in words ("modelled from 2 scans", a file's name), `scans` their names.

    `rms_m` [m], `explained` and `seen` (shares) are those of the model against its scans, None where there were none.
    `assumed_faces`: faces that no scan has confirmed.
    """

    source: str = ""
    scans: tuple[str, ...] = ()
    rms_m: float | None = None
    explained: float | None = None
    seen: float | None = None
    assumed_faces: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Part(Value):
    """A known polyhedral part. Its frame is that of its model file; `density` [kg/m³], `friction` against the fingers."""

    name: str
    solid: Polyhedron
    density: float = 700.0
    friction: float = 0.5
    mates: dict[str, Mate] = field(default_factory=dict)
    provenance: Provenance = Provenance()

    @cached_property
    def pieces(self) -> tuple[NDArray, ...]:
        """Exact convex pieces, corners (k, 3) [m] in the part's frame."""
        return convex_pieces(self.solid)

    @cached_property
    def symmetries(self) -> NDArray:
        """T_part_part (k, 4, 4) that leave its looks unchanged, the identity first."""
        return symmetries(self.solid)

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return self.density * self.solid.volume_and_centroid[0]

    def lowest(self, T_world_part: NDArray) -> float:
        """z [m] of its lowest corner at a pose."""
        return float((self.solid.vertices @ T_world_part[2, :3] + T_world_part[2, 3]).min())


@dataclass(frozen=True, eq=False)
class PlacedPart(Value):
    """A part believed to stand at a pose. `name` is its instance, such as `l_block#2`."""

    name: str
    part: Part
    T_world_part: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_part", frozen_array(self.T_world_part))

    @property
    def corners_world(self) -> NDArray:
        """Corners (n, 3) [m]."""
        return self.part.solid.vertices @ self.T_world_part[:3, :3].T + self.T_world_part[:3, 3]


@dataclass(frozen=True, eq=False)
class Held(Value):
    """A part in the hand: `T_hand_part` (4, 4) maps it to the hand's frame."""

    name: str
    part: Part
    T_hand_part: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_hand_part", frozen_array(self.T_hand_part))

    @property
    def width(self) -> float:
        """Extent [m] along the closing direction: how far the fingers are open while they hold it, for parallel faces."""
        x = self.part.solid.vertices @ self.T_hand_part[0, :3]
        return float(np.ptp(x))
