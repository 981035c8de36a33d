"""What the program proposes: a closed solid, what each of its faces rests on, and what else was tried."""

from dataclasses import dataclass

from numpy.typing import NDArray

from handey_studio.base import Entry, Value, frozen_array
from handey_studio.geometry import Polyhedron


@dataclass(frozen=True)
class Relation:
    """A regularity that was found within its limit and enforced: `kind` "right angle", "parallel" or "equal"; between `faces` of
    the solid (or its edges' faces); `off` is by how much the data differed from it, `limit` what it was held against, both in `unit`."""

    kind: str
    faces: tuple[int, ...]
    off: float
    limit: float
    unit: str = "rad"


@dataclass(frozen=True, eq=False)
class Suggestion(Value):
    """A closed polyhedron for one object, in the model frame; `solid` is None where none is dared, and `reason` says why.

    `sources` has one word for each face: "seen in scan 1", "assumed: support", "assumed: parallel" (opposite of a face that is seen),
    "assumed: symmetric" or "assumed: hidden". `rms` [m] is that of the readings on it, `explained` their share of the object's readings.
    `patches` are (scan, patch) that it explains; `entries` tell every candidate and why it fell.
    """

    solid: Polyhedron | None
    sources: tuple[str, ...]
    relations: tuple[Relation, ...]
    entries: tuple[Entry, ...]
    rms: float
    explained: float
    patches: tuple[tuple[int, int], ...]
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Alignment(Value):
    """How another scan lies in the model frame: `T_model_scan` (4, 4), None when nothing fits, and `reason` says why.

    `residuals` [m]: the distance rms of each shared plane's readings, as (patch of the model's scans as (scan, patch), patch of the new
    scan, rms); `rms` over all. `others`: poses that fit nearly as well, best first, with their rms [m]: the object cannot tell them apart.
    """

    T_model_scan: NDArray | None
    residuals: tuple[tuple[tuple[int, int], int, float], ...]
    rms: float
    others: tuple[tuple[NDArray, float], ...]
    entries: tuple[Entry, ...]
    reason: str = ""

    def __post_init__(self) -> None:
        if self.T_model_scan is not None:
            object.__setattr__(self, "T_model_scan", frozen_array(self.T_model_scan))
