"""What a click snaps to: a corner, an edge, a plane, or a reading as it is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array

MODEL = -1  # the owner of what belongs to the model, not to a scan


@dataclass(frozen=True, eq=False)
class Ray(Value):
    """A click: where the eye is [m] and the direction (3,) that it looks in through the pixel, in the model frame.

    `pixel_rad` [rad] is how wide one pixel of the screen is in the middle: 2·tan(fov/2) / height.
    """

    origin: NDArray
    direction: NDArray
    pixel_rad: float = 0.001

    def __post_init__(self) -> None:
        direction = np.asarray(self.direction, dtype=float)
        object.__setattr__(self, "origin", frozen_array(self.origin))
        object.__setattr__(self, "direction", frozen_array(direction / max(float(np.linalg.norm(direction)), 1e-300)))


@dataclass(frozen=True)
class SnapOptions:
    """What a click may snap to, in order of preference, and from how many pixels of the screen each draws it.

    `kinds` without "vertex", "edge" or "plane" leaves these out; without any of them the reading or surface point itself is taken.
    The model's own features count as `model_px` nearer than a patch's. `to_model` and `scans` say what can be hit at all: the solid,
    and which scans (None: all). `hidden_m` [m]: a feature deeper than this behind what its own line of sight meets first is hidden.
    """

    kinds: tuple[str, ...] = ("vertex", "edge", "plane")
    vertex_px: float = 14.0
    edge_px: float = 9.0
    model_px: float = 4.0
    to_model: bool = True
    scans: tuple[int, ...] | None = None
    hidden_m: float = 0.004


@dataclass(frozen=True, eq=False)
class Snap(Value):
    """Where a click went, in the model frame.

    `kind`: "vertex", "edge" (of the model or of a patch's outline), "plane" (a model's face or a patch) or "point" (a reading).
    `point` (3,) [m]. `direction` (3,): the edge's unit direction, zeros if there is none. `normal` (3,): the outward unit normal of
    the face or patch hit, zeros if there is none. `owner`: the number of the scan, or `MODEL`; `number`: of the model's vertex, edge
    (in `Polyhedron.edges`) or face; of the scan's patch; -1 for a reading. `of` says it in words. `distance_px`: from the click.
    """

    kind: str
    point: NDArray
    direction: NDArray
    normal: NDArray
    owner: int
    number: int
    of: str
    distance_px: float

    def __post_init__(self) -> None:
        for key in ("point", "direction", "normal"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))
