"""The values of a MOVE: the command, its plan step by step, and the result with everything that was tried."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Entry, Value, frozen_array
from handey_studio.grasping import BumpRun, ForbiddenRange, Grip
from handey_studio.motion import Certificate, CSpaceSummary
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.task.acting.performance import Check, Incident, Performance, Recovery
from handey_studio.world import PlacedPart

StepKind = Literal["free", "approach", "close", "lift", "transfer", "regrasp", "place", "open", "retreat"]


@dataclass(frozen=True)
class MoveCommand:
    """MOVE `part` TO `to`. `part` is a part's name or an instance (`l_block#2`); `to` a destination as it was typed:
    `x,y,z[,roll,pitch,yaw]` (metres, degrees), `on:PART[:POSE]` or `in:x0,y0,x1,y1`."""

    part: str
    to: str


@dataclass(frozen=True, eq=False)
class Step(Value):
    """One step of a plan: a timed joint path with the hand's opening, what it holds, and the pairs that may touch.

    `q_rad` (n, joints), `time_s` (n,) from zero, `hand_opening_m` (n,). `T_hand_part` (4, 4) when something is held. `clearance_m` (n,) how
    far whatever may not touch is apart at each time, beyond 50 mm not told apart; empty in plans of earlier versions.
    """

    kind: StepKind
    joint_names: tuple[str, ...]
    time_s: NDArray
    q_rad: NDArray
    hand_opening_m: NDArray
    held: str | None
    T_hand_part: NDArray | None
    allowed_contacts: tuple[tuple[str, str], ...]
    clearance_m: NDArray = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        for key in ("time_s", "q_rad", "hand_opening_m", "clearance_m"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))
        if self.T_hand_part is not None:
            object.__setattr__(self, "T_hand_part", frozen_array(self.T_hand_part))


@dataclass(frozen=True, eq=False)
class GraspChoice(Value):
    """The grasp that a plan uses: its class and approach group in words and numbers.

    `T_hand_part` (4, 4) is the grasp itself. `faces` are the grasped faces, `edge_part` (2, 3) [m] the edge that is crossed first, both
    of the part; `contact_part` (k, 3) [m] the outline of where the faces face each other, in the grasp plane. `angle` and the
    legal `ranges` (m, 2) [rad] are hand angles in the grasp plane. `tilts` [rad] of the fingers from straight down at pickup and putdown.
    `grip` is how well it holds the part at the worst turn of the whole carry, `forbidden` the hand angles that were not legal and what
    forbade them, at both ends; None and empty in plans of earlier versions.
    """

    name: str
    faces: tuple[int, ...]
    group: str
    T_hand_part: NDArray
    T_part_plane: NDArray
    edge_part: NDArray
    contact_part: NDArray
    angle: float
    ranges: NDArray
    tilts: tuple[float, float]
    width: float
    opening: float
    contact_area: float
    joint_margin: float
    grip: Grip | None = None
    forbidden: tuple[ForbiddenRange, ...] = ()

    def __post_init__(self) -> None:
        for key in ("T_hand_part", "T_part_plane", "edge_part", "contact_part", "ranges"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))


@dataclass(frozen=True, eq=False)
class Carry(Value):
    """One pickup and putdown of a plan: all of it, or a stretch between two regrasps.

    Poses (4, 4); the start may be named by another symmetry of the part than the goal of the carry before. `approach` is the bump-line run
    at the pickup, `space` the configuration space of the transfer, `first_step` the plan's first step that belongs to it. `lifting` and
    `lowering` are those that led the part in hand out of its place and into the other, None where it went straight up and straight down.
    """

    T_world_part_start: NDArray
    T_world_part_goal: NDArray
    grasp: GraspChoice
    approach: BumpRun
    space: CSpaceSummary | None = None
    first_step: int = 0
    lifting: BumpRun | None = None
    lowering: BumpRun | None = None

    def __post_init__(self) -> None:
        for key in ("T_world_part_start", "T_world_part_goal"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))


@dataclass(frozen=True, eq=False)
class MovePlan(Value):
    """A full plan: one carry, or several with a regrasp between each two."""

    part: str
    carries: tuple[Carry, ...]
    steps: tuple[Step, ...]
    certificate: Certificate

    @property
    def regrasps(self) -> int:
        """How often the part is put down on the way."""
        return len(self.carries) - 1

    @property
    def T_world_part_start(self) -> NDArray:
        return self.carries[0].T_world_part_start

    @property
    def T_world_part_goal(self) -> NDArray:
        return self.carries[-1].T_world_part_goal

    @property
    def duration(self) -> float:
        """Length of all steps together [s]."""
        return sum(float(step.time_s[-1]) for step in self.steps)

    def carry_at(self, step: int) -> Carry:
        """The carry that a step belongs to."""
        return [carry for carry in self.carries if carry.first_step <= max(step, 0)][-1]


@dataclass(frozen=True, eq=False)
class Attempt(Value):
    """A plan that was carried out and did not end well: how it went, and what was decided then. `scan` is what it was made on, with the
    instances `located` in it; None and empty in sessions of earlier versions."""

    plan: MovePlan
    performance: Performance
    recovery: Recovery
    scan: DepthMap | None = None
    located: tuple[PlacedPart, ...] = ()


@dataclass(frozen=True, eq=False)
class MoveResult(Value):
    """What became of a MOVE. `ledger` holds everything that was tried; `timing_s` seconds a stage.

    `T_world_part_start` and `T_world_part_goal` are known as soon as the part was located and the destination understood; `_reached` is
    where the part was seen at the end, or by the arm's joints where it cannot be seen. `attempts` are those that did not end well, each
    with its plan; `performance` is that of `plan`, None until it is carried out.
    """

    command: MoveCommand
    status: Literal["planned", "done", "failed"]
    reason: str
    plan: MovePlan | None = None
    T_world_part_start: NDArray | None = None
    T_world_part_goal: NDArray | None = None
    T_world_part_reached: NDArray | None = None
    ledger: tuple[Entry, ...] = ()
    timing_s: dict[str, float] = field(default_factory=dict)
    physics: bool = False
    performance: Performance | None = None
    attempts: tuple[Attempt, ...] = ()

    @property
    def performances(self) -> tuple[Performance, ...]:
        """Every attempt's, in order."""
        return (*(attempt.performance for attempt in self.attempts), *((self.performance,) if self.performance else ()))

    @property
    def incidents(self) -> tuple[Incident, ...]:
        """Everything that was noticed, in order."""
        return tuple(incident for performance in self.performances for incident in performance.incidents)

    @property
    def check(self) -> Check | None:
        """What the last scan told of the part, None before it."""
        return self.performance.check if self.performance else None
