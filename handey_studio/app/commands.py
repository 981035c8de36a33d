"""What a user can ask for, as values. Those here only make the next state; those that touch files, the planner or a
single browser are in `actions.py`."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from handey_studio.app.browsing import (
    LEDGER_ROWS,
    browsed_hypotheses,
    edges_shown,
    filtered,
    ledger_of,
    ledger_page,
    listed,
    page_of,
    wired,
)
from handey_studio.app.modelling.clicks import click_taken_back
from handey_studio.app.settings import with_robot
from handey_studio.app.state import State, redone, undone, with_view
from handey_studio.base import BadInput
from handey_studio.geometry.transforms import is_rigid
from handey_studio.session.checks import MAX_ATTEMPTS, MAX_IMPROVE
from handey_studio.session.command_list import with_commands
from handey_studio.session.destination import check_command, destination_pose, destinations_on_parts, snapped
from handey_studio.session.ledger_tree import ROOT, children_of, path_to
from handey_studio.session.looking import edge_at, hypotheses_at
from handey_studio.task.destination import format_pose
from handey_studio.task.plan import MoveCommand

POSE_LABEL = "a pose on the table"
FREE_TABLE = "0.35,-0.35,0,0,0,0"  # beside the scan area, in every robot's reach


class Command(Protocol):
    """A command that makes the next state and does nothing else. Raises BadInput with one sentence."""

    def apply(self, state: State) -> State: ...


@dataclass(frozen=True)
class ChoosePart:
    """MOVE this part, to where parts of its kind can go."""

    part: str

    def apply(self, state: State) -> State:
        part = state.session.part(self.part)
        if part is None:
            raise BadInput(f'part "{self.part}" is not in this workcell; it has {", ".join(state.session.workcell.parts) or "none"}.')
        mates = destinations_on_parts(state.session, part)
        free = state.command is not None and not state.command.to.startswith("on:")
        to = state.command.to if state.command and free else (mates[0] if mates else FREE_TABLE)
        return _with_command(state, f"choose {self.part}", MoveCommand(self.part, to))


@dataclass(frozen=True)
class SetDestination:
    """TO these words: `x,y,z[,roll,pitch,yaw]`, `on:PART[:POSE]` or `in:x0,y0,x1,y1`."""

    to: str
    label: str = "set destination"

    def apply(self, state: State) -> State:
        if state.command is None:
            raise BadInput("choose a part to move first.")
        return _with_command(state, self.label, MoveCommand(state.command.part, self.to))


@dataclass(frozen=True, eq=False)
class DropGhost:
    """The ghost was let go at this pose; it snaps."""

    T_world_part: NDArray

    def apply(self, state: State) -> State:
        part = state.session.part(state.command.part) if state.command else None
        if part is None or not is_rigid(self.T_world_part, 1e-3):
            return state
        to = format_pose(snapped(part, self.T_world_part, state.session.workcell.table_z))
        return SetDestination(to, "drag destination").apply(state)


@dataclass(frozen=True)
class FreePose:
    """The destination becomes a pose of its own, where the ghost is now, or on free table if it has no place yet."""

    def apply(self, state: State) -> State:
        pose = destination_pose(state.session, state.command) if state.command else None
        to = format_pose(pose) if pose is not None else FREE_TABLE
        return SetDestination(to, f"choose {POSE_LABEL}").apply(state)


@dataclass(frozen=True)
class SetSeed:
    seed: int

    def apply(self, state: State) -> State:
        if not 0 <= self.seed < 2**31:
            raise BadInput(f"the seed is {self.seed}; it must be a whole number from 0 to {2**31 - 1}.")
        return state.changed("set seed", replace(state.session, seed=self.seed))


@dataclass(frozen=True)
class SetAttempts:
    """How often a MOVE is tried, the first time among them."""

    attempts: int

    def apply(self, state: State) -> State:
        return state.changed("set attempts", replace(state.session, attempts=min(max(1, self.attempts), MAX_ATTEMPTS)))


@dataclass(frozen=True)
class SetImprove:
    """How many more plans are looked at once there is one."""

    improve: int

    def apply(self, state: State) -> State:
        return state.changed("look for a better plan", replace(state.session, improve=min(max(0, self.improve), MAX_IMPROVE)))


@dataclass(frozen=True)
class Undo:
    """The last change is taken back; while a tool of the modeller waits for its next click, that tool's last click."""

    def apply(self, state: State) -> State:
        before = click_taken_back(state)
        return undone(state) if before is None else before


@dataclass(frozen=True)
class Redo:
    def apply(self, state: State) -> State:
        return redone(state)


@dataclass(frozen=True)
class LookAt:
    """Look at one hypothesis, and at no single edge beside its own; -1 for none."""

    number: int

    def apply(self, state: State) -> State:
        count = len(state.session.scene.located.hypotheses) if state.session.scene else 0
        return with_view(state, hypothesis=self.number if 0 <= self.number < count else -1, edge=-1)


@dataclass(frozen=True)
class Browse:
    """Look at the hypothesis so many places further down the list; past its end it begins again."""

    by: int

    def apply(self, state: State) -> State:
        listed = browsed_hypotheses(state)
        if not listed:
            return state.told("There is no hypothesis to look at yet; Plan or MOVE scans the table first.")
        now = state.session.view.hypothesis
        place = listed.index(now) + self.by if now in listed else (0 if self.by > 0 else -1)
        return LookAt(listed[place % len(listed)]).apply(state)


@dataclass(frozen=True)
class BrowseRow:
    """Look at the hypothesis in this row of the list, or no longer, if it is the one that is looked at."""

    row: int

    def apply(self, state: State) -> State:
        listed = page_of(state)
        if self.row >= len(listed):
            return state
        number = listed[self.row]
        return LookAt(-1 if number == state.session.view.hypothesis else number).apply(state)


@dataclass(frozen=True)
class FilterHypotheses:
    """List only those of a part, or with a verdict; an empty word is for all."""

    part: str | None = None
    verdict: str | None = None

    def apply(self, state: State) -> State:
        part = state.hypothesis_part if self.part is None else self.part
        verdict = state.hypothesis_verdict if self.verdict is None else self.verdict
        state = replace(state, hypothesis_part=part, hypothesis_verdict=verdict)
        listed = browsed_hypotheses(state)
        looked_at = state.session.view.hypothesis
        return state if looked_at < 0 or looked_at in listed else LookAt(listed[0] if listed else -1).apply(state)


@dataclass(frozen=True)
class FilterEdges:
    """Show only data edges at least so long [m]."""

    min_m: float

    def apply(self, state: State) -> State:
        state = replace(state, edge_min_m=max(0.0, self.min_m))
        return state if state.session.view.edge in (-1, *edges_shown(state)) else Select("edge", -1).apply(state)


@dataclass(frozen=True)
class ShowLayer:
    layer: str
    shown: bool

    def apply(self, state: State) -> State:
        hidden = tuple(layer for layer in state.session.view.hidden_layers if layer != self.layer)
        return with_view(state, hidden_layers=hidden if self.shown else (*hidden, self.layer))


@dataclass(frozen=True)
class Select:
    """Look at one data edge or result; -1 for none (the last result)."""

    kind: str
    number: int

    def apply(self, state: State) -> State:
        if self.kind == "result":
            state = with_view(state, time_s=0.0, attempt=0)
        return with_view(state, **{self.kind: self.number})


@dataclass(frozen=True, eq=False)
class PointAt:
    """A click into the scene along a ray: it looks at the hypothesis or else the data edge there, if one is shown there.

    Where several hypotheses have their wires, each further click looks at the next of them.
    """

    origin: NDArray
    direction: NDArray

    def apply(self, state: State) -> State:
        session = state.session
        if session.scene is None or state.modelling:
            return state
        there = hypotheses_at(session.scene, session.parts, wired(state), self.origin, self.direction)
        if there:
            now = session.view.hypothesis
            return LookAt(there[(there.index(now) + 1) % len(there)] if now in there else there[0]).apply(state)
        shown = edges_shown(state)
        found = edge_at([session.scene.located.edges[k] for k in shown], self.origin, self.direction)
        return state if found < 0 else Select("edge", shown[found]).apply(state)


@dataclass(frozen=True)
class ResetCell:
    """The cell as it was before the first MOVE, and nothing sensed or planned."""

    def apply(self, state: State) -> State:
        if state.job is not None:
            raise BadInput("the planner is at work; cancel first or wait for it.")
        return replace(state, session=state.session.without_findings(), playing=False)


@dataclass(frozen=True)
class ChooseRobot:
    """Another arm of the library stands in the workcell."""

    robot: str

    def apply(self, state: State) -> State:
        return state.changed("choose robot", with_robot(state.session, self.robot))


@dataclass(frozen=True)
class FilterLedger:
    stage: str | None = None
    only: str | None = None
    words: str | None = None

    def apply(self, state: State) -> State:
        return replace(
            state,
            ledger_stage=state.ledger_stage if self.stage is None else self.stage,
            ledger_only=state.ledger_only if self.only is None else self.only,
            ledger_words=state.ledger_words if self.words is None else self.words[:80],
            ledger_page=0,
        )


@dataclass(frozen=True)
class LedgerRow:
    """Look at the entry in a row of the ledger's page, and at what is below it."""

    row: int

    def apply(self, state: State) -> State:
        page = ledger_page(state)
        if not 0 <= self.row < len(page):
            return state
        entry = page[self.row]
        state = replace(state, ledger_entry=entry.id)
        if filtered(state) or entry.id not in children_of(ledger_of(state)):
            return state
        return replace(state, ledger_at=entry.id, ledger_page=0)


@dataclass(frozen=True)
class LedgerUp:
    """Back to the branches that the one listed belongs to; its top at last looks at nothing."""

    def apply(self, state: State) -> State:
        path = path_to(ledger_of(state), state.ledger_at)
        above = path[-2].id if len(path) > 1 else ROOT
        return replace(state, ledger_at=above, ledger_page=0, ledger_entry=above)


@dataclass(frozen=True)
class LedgerPage:
    """The next page of entries (+1) or the one before (−1)."""

    by: int

    def apply(self, state: State) -> State:
        last = max(0, (len(listed(state)) - 1) // LEDGER_ROWS)
        return replace(state, ledger_page=min(max(state.ledger_page + self.by, 0), last))


@dataclass(frozen=True)
class LookAtNoEntry:
    """The scene shows the plan again, not what fell."""

    def apply(self, state: State) -> State:
        return replace(state, ledger_entry=ROOT)


@dataclass(frozen=True, eq=False)
class CameraMoved:
    """A browser's camera stands here (3,) and looks there (3,) [m]; kept so that reopening shows the same view."""

    position: NDArray
    look_at: NDArray

    def apply(self, state: State) -> State:
        if not (np.isfinite(self.position).all() and np.isfinite(self.look_at).all()):
            return state
        return with_view(state, camera_position=self.position, camera_look_at=self.look_at)


@dataclass(frozen=True)
class Viewers:
    """A browser came or went."""

    by: int

    def apply(self, state: State) -> State:
        return replace(state, viewers=max(0, state.viewers + self.by))


@dataclass(frozen=True)
class Tell:
    text: str
    kind: str = "info"
    client: int | None = None

    def apply(self, state: State) -> State:
        return state.told(self.text, self.kind, self.client)


def _with_command(state: State, label: str, command: MoveCommand) -> State:
    """The MOVE set up anew; whoever sets it up looks at its ghost, no longer at a hypothesis."""
    check_command(state.session, command)
    session = with_view(state, hypothesis=-1).session
    commands = list(session.commands) or [command]
    commands[state.command_number] = command
    return state.changed(label, with_commands(session, tuple(commands)))
