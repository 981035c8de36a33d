"""What happened when a plan was carried out: the values that the screen, the JSON, sessions and tests read."""

from dataclasses import dataclass, fields, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array, measured
from handey_studio.cell.protocol import Ending
from handey_studio.cell.recording import Recording, Tracking
from handey_studio.task.ruled_out import RuledOut
from handey_studio.world import Block

MOST_SAMPLES = 64  # of one motion are kept: 25 a second of the longest ordinary ones

IncidentKind = Literal[
    "missed",  # the fingers closed on nothing, or on something of another width
    "slipped",  # the part moved in the fingers
    "dropped",  # the part is no longer in the fingers
    "wrong place",  # it stands elsewhere than commanded
    "blocked",  # the arm could not follow its motion
    "moved",  # the scene is no longer as it was scanned
    "early contact",  # the descent met something above the destination
    "late contact",  # the descent met nothing at the destination
    "hand stuck",  # the fingers do not go where they are sent
    "refused",  # the cell would not do it
    "stopped",  # somebody stopped it
]


@dataclass(frozen=True)
class Incident:
    """Something that went otherwise than planned, noticed at plan step `step`: -1 before the first, the number of steps after the last.

    `value` is what was measured and `limit` what it was held against, in `unit` as in the ledger; `sentence` tells it to a person. One
    that was `overcome` on the spot did not end the attempt. `entry` is the id of the result's ledger entry that tells of it, -1 before that
    is written.
    """

    kind: IncidentKind
    step: int
    sentence: str
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    overcome: bool = False
    entry: int = -1

    def __str__(self) -> str:
        number = "" if self.value is None else f": {measured(self.value, self.unit)}"
        limit = "" if self.value is None or self.limit is None else f", limit {measured(self.limit, self.unit)}"
        return f"{self.sentence}{number}{limit}"


@dataclass(frozen=True, eq=False)
class Performed(Value):
    """One motion as it was performed, begun `start_s` of the cell's time after the attempt's begin.

    `step` counts the plan's steps, -1 on the way back after an incident; `what` is the step's kind or what was done besides.
    """

    step: int
    what: str
    start_s: float
    ended: Ending
    recording: Recording
    tracking: Tracking


@dataclass(frozen=True, eq=False)
class Check(Value):
    """What the scan after the release tells of the part.

    `found`: it was located near its place (`seen`); not recognised, but the readings at its place are as of it (`agrees`); nobody can
    see its place (`hidden`); or its place is empty or taken by something else (`not there`). `T_world_part` (4, 4) where it was seen, in
    the naming of its symmetry that is nearest to the command, `off_m` and `off_rad` from there; None where it was not, and `sentence` tells
    what else was measured. `rivals`: what the view cannot tell it from.
    """

    found: Literal["seen", "agrees", "hidden", "not there"]
    sentence: str
    T_world_part: NDArray | None = None
    off_m: float | None = None
    off_rad: float | None = None
    rivals: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.T_world_part is not None:
            object.__setattr__(self, "T_world_part", frozen_array(self.T_world_part))


@dataclass(frozen=True, eq=False)
class Performance(Value):
    """One attempt to carry out a plan: its motions in order, what was noticed, and the check if it came to that.

    `T_world_part_released` (4, 4) is where the part was by the arm's joints when the fingers let go of it.
    """

    performed: tuple[Performed, ...] = ()
    incidents: tuple[Incident, ...] = ()
    T_world_part_released: NDArray | None = None
    check: Check | None = None

    def __post_init__(self) -> None:
        if self.T_world_part_released is not None:
            object.__setattr__(self, "T_world_part_released", frozen_array(self.T_world_part_released))

    @property
    def seconds(self) -> float:
        """How long it took by the cell's time."""
        return max((one.start_s + float(one.recording.time_s[-1]) for one in self.performed), default=0.0)

    @property
    def tracking(self) -> Tracking:
        """How far the arm was off its command at most."""
        joint = max((one.tracking.joint_rad for one in self.performed), default=0.0)
        return Tracking(joint, max((one.tracking.hand_mm for one in self.performed), default=0.0))


@dataclass(frozen=True, eq=False)
class Recovery(Value):
    """What was decided after an incident, and why. `actions` in words, in order: what was done with the arm and the part, then how it goes
    on; `ruled_out` is not tried again, `felt` is a block that the planner now takes to stand where something was touched. `again`: whether
    another attempt follows.
    """

    incident: Incident
    why: str
    actions: tuple[str, ...] = ()
    ruled_out: RuledOut | None = None
    felt: Block | None = None
    again: bool = True


def thinned(recording: Recording, most: int = MOST_SAMPLES) -> Recording:
    """A recording with at most `most` samples: its ends, those at events, the one with the greatest force, the others evenly."""
    n = len(recording.time_s)
    if n <= most:
        return recording
    times = [event.time_s for event in recording.events][: most // 4]
    told = [0, n - 1, int(np.argmax(np.linalg.norm(recording.force_N, axis=1))), *np.searchsorted(recording.time_s, times).tolist()]
    even = np.linspace(0, n - 1, most - len(told)).round().astype(int)
    keep = np.unique(np.clip(np.append(even, told), 0, n - 1))
    columns = {field.name: getattr(recording, field.name)[keep] for field in fields(Recording) if field.name != "events"}
    return replace(recording, **columns)
