"""Patches: the planar faces that a scan shows, with their outlines, and the objects that they belong to (Handey 1987 §1)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array

SUPPORT = -2  # the support's number among a scan's patches


@dataclass(frozen=True)
class Border:
    """What one side of a patch's outline is.

    `kind`: "crease" (meets patch `other` there), "foot" (meets the support), "rim" (the object ends: what lies behind is farther),
    "cut" (a nearer thing hides the rest), "image" (the view or its readings end). At a rim or a cut `other` is the patch beyond it, or -1.
    `sigma` [m] tells how well a rim or a cut is known sideways, 0 where planes tell it.
    """

    kind: str
    other: int = -1
    sigma: float = 0.0


@dataclass(frozen=True, eq=False)
class Patch(Value):
    """A planar face as far as a scan shows it, in the scan's world frame.

    On the plane `normal` · x = `offset` [m], the unit normal (3,) towards the sensor. `rings`: the outline (n, 3) [m] with straight
    sides, counter-clockwise seen from outside, then holes, clockwise. `borders` has one `Border` for each side of each ring, the one that
    starts at that corner. `rms` [m] of its `readings` off the plane, `area` [m²] inside the outline. `bend` [m]: how far the means over
    its parts lie off the plane, as cartons bulge and sensors warp; `tilt` [rad]: so much may its normal be off therefore. `object` is the
    number in `Patches.objects`.
    """

    number: int
    normal: NDArray
    offset: float
    rings: tuple[NDArray, ...]
    borders: tuple[tuple[Border, ...], ...]
    rms: float
    area: float
    readings: int
    bend: float
    tilt: float
    object: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", frozen_array(self.normal))
        object.__setattr__(self, "rings", tuple(frozen_array(ring) for ring in self.rings))


@dataclass(frozen=True)
class Crease:
    """Where patches `a` < `b` meet; `convex` if the body's edge points outward there. `readings` beside it."""

    a: int
    b: int
    convex: bool
    readings: int


@dataclass(frozen=True, eq=False)
class Patches(Value):
    """The planar faces that one scan shows. `labels` (H, W): the patch of each reading, -1 none, -2 on the support.

    `objects`: which patches belong to which separate body above the support, the largest first; `creases` where patches meet.
    """

    labels: NDArray
    patches: tuple[Patch, ...]
    objects: tuple[tuple[int, ...], ...]
    creases: tuple[Crease, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", frozen_array(self.labels, np.int32))
