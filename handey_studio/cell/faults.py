"""What may go wrong in a simulated cell, on purpose: as data of its setup. Nobody but the cell reads it."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.base.errors import unknown_name
from handey_studio.geometry.transforms import is_rigid

FaultKind = Literal["slip", "push", "bias", "obstacle", "stuck", "blocked"]
Call = Literal["scan", "follow", "descend", "settle", "grip"]
FOREVER_S = 1e9
MAX_FAULTS = 100


@dataclass(frozen=True, eq=False)
class Fault(Value):
    """One fault: it begins `time_s` of the cell's own time after the start of the `count`th `call` (from 1) and lasts `lasts_s`.

    - `slip`: the friction between the fingers and what they hold falls to the share `size` of what it was.
    - `push`: the force `vector` (3,) [N] acts on the body called `body`; "" is what the hand holds.
    - `bias`: scans come out shifted by `vector` (3,) [m] in the world; `lasts_s` 0 is the one scan that `count` names.
    - `obstacle`: a cuboid of the size `vector` (3,) [m] stands at `T_world_body` from then on; scans before do not show it.
    - `stuck`: the fingers' drive stays where it is when it comes to the opening `size` [m], or at once if it is beyond.
    - `blocked`: the joint of the number `size` is jammed.
    """

    kind: FaultKind
    call: Call
    count: int = 1
    time_s: float = 0.0
    lasts_s: float = FOREVER_S
    size: float = 0.0
    vector: NDArray = field(default_factory=lambda: np.zeros(3))
    T_world_body: NDArray = field(default_factory=lambda: np.eye(4))
    body: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "vector", frozen_array(self.vector))
        object.__setattr__(self, "T_world_body", frozen_array(self.T_world_body))


def check_faults(faults: Sequence[Fault], bodies: Collection[str], joints: int) -> None:
    """BadInput for faults that a cell with these free bodies and so many joints cannot have."""
    if len(faults) > MAX_FAULTS:
        raise BadInput(f"the cell has {len(faults)} faults; the limit is {MAX_FAULTS}.")
    for fault in faults:
        numbers = np.array([fault.time_s, fault.lasts_s, fault.size, *fault.vector])
        if fault.count < 1 or fault.vector.shape != (3,) or not np.isfinite(numbers).all() or (numbers[:3] < 0).any():
            raise BadInput(f'a fault of kind "{fault.kind}" needs a count from 1, finite numbers, and no time or size below 0.')
        if fault.body and fault.body not in bodies:
            raise unknown_name("body", fault.body, bodies)
        if fault.kind == "obstacle" and not (is_rigid(fault.T_world_body) and (fault.vector > 0).all()):
            raise BadInput(f"an obstacle needs a rigid pose and sides above 0 m, not {fault.vector.tolist()}.")
        if fault.kind == "blocked" and fault.size not in range(joints):
            raise BadInput(f"joint {fault.size:g} cannot jam; the arm has joints 0 to {joints - 1}.")
