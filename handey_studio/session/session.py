"""The Session value: everything a user did, from the workcell to the last plan, and how they were looking at it."""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.cell.workcell import SimulatedSetup, Workcell
from handey_studio.modeling.draft import Draft
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.task.plan import MoveCommand, MoveResult
from handey_studio.task.sense import Scene
from handey_studio.world import Library, Part, PlacedPart

LAYERS = (
    "robot",
    "planned arm",
    "depth map",
    "located parts",
    "data edges",
    "hypothesis",
    "other hypotheses",
    "pair of edges",
    "residuals",
    "grasp",
    "hand path",
    "clearance",
    "configuration space",
    "wrist box",
    "destination",
    "plots",
    "labels",
)


@dataclass(frozen=True, eq=False)
class ViewState(Value):
    """How the user was looking: the camera in the world [m], the timeline's time [s], what is selected and what is hidden.

    `hypothesis` and `edge` count into what was sensed, -1 for none; `result` counts the session's
    results and `attempt` that result's attempts, -1 for the last.
    """

    camera_position: NDArray = field(default_factory=lambda: np.array([1.56, -1.10, 0.98]))
    camera_look_at: NDArray = field(default_factory=lambda: np.array([0.31, 0.01, 0.05]))
    time_s: float = 0.0
    hypothesis: int = -1
    edge: int = -1
    result: int = -1
    attempt: int = -1
    hidden_layers: tuple[str, ...] = ("configuration space", "plots")

    def __post_init__(self) -> None:
        object.__setattr__(self, "camera_position", frozen_array(self.camera_position))
        object.__setattr__(self, "camera_look_at", frozen_array(self.camera_look_at))


@dataclass(frozen=True)
class CommandState:
    """How far a command of the session's list is. `result` counts the session's results, -1 while it has none; that of a command which is
    postponed tells why."""

    status: Literal["waiting", "running", "done", "postponed", "failed", "skipped"] = "waiting"
    result: int = -1


@dataclass(frozen=True, eq=False)
class Session(Value):
    """One working session, self-contained: it opens on a machine that lacks its parts.

    `parts` are the models that `workcell.parts` names. `scene` and `results` are what sensing and planning found,
    empty before. `attempts` is how often a MOVE is tried, the first time among them; `improve` how many more plans are looked at once there
    is one. `states` tells how far each of the commands is, one each, or none while they were never run as a list.
    `cell_now` is where the simulated bodies stand after what was executed, None while nothing was; only the cell reads it.
    `draft` is the part that is being modelled, None while none is.
    """

    name: str
    workcell: Workcell
    parts: tuple[Part, ...] = ()
    commands: tuple[MoveCommand, ...] = ()
    seed: int = 0
    attempts: int = 3
    improve: int = 0
    scene: Scene | None = None
    results: tuple[MoveResult, ...] = ()
    states: tuple[CommandState, ...] = ()
    cell_now: SimulatedSetup | None = None
    draft: Draft | None = None
    view: ViewState = field(default_factory=ViewState)

    @property
    def scan(self) -> DepthMap | None:
        """The depth map, None before the first scan."""
        return self.scene.depth_map if self.scene else None

    @property
    def located(self) -> tuple[PlacedPart, ...]:
        """The instances that were found in it."""
        return self.scene.instances if self.scene else ()

    @property
    def result(self) -> MoveResult | None:
        """The result that is looked at."""
        if not self.results:
            return None
        return self.results[self.view.result] if -1 <= self.view.result < len(self.results) else self.results[-1]

    def part(self, name: str) -> Part | None:
        """The model of a part or of one of its instances, such as `l_block#2`."""
        return next((part for part in self.parts if part.name == name.split("#")[0]), None)

    def without_findings(self) -> "Session":
        """The session as before its first scan: what the user set stays, what was sensed and planned goes."""
        view = replace(self.view, time_s=0.0, hypothesis=-1, edge=-1, result=-1)
        return replace(self, scene=None, results=(), states=(), cell_now=None, view=view)


def new_session(name: str, workcell: Workcell, library: Library, commands: tuple[MoveCommand, ...] = (), seed: int = 0) -> Session:
    """A session about a workcell, with the models of its parts taken from the library. Raises BadInput for unknown names."""
    library.robot(workcell.robot)
    return Session(name, workcell, tuple(library.part(part) for part in workcell.parts), commands, seed)
