"""The workbench's state: one frozen value. The next state is a new value; nothing here knows of a browser."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from handey_studio.app.grasp_look import GraspLook
from handey_studio.app.modelling.look import ModelLook
from handey_studio.app.outcome import Outcome
from handey_studio.app.settings import Settings
from handey_studio.base import BadInput, Entry
from handey_studio.localization import Hypothesis
from handey_studio.localization.explain import Explanation
from handey_studio.session import Moment, Replay, Session, Told, attempts_of, replay_of
from handey_studio.session.handling import Handling
from handey_studio.session.ledger_tree import ROOT
from handey_studio.session.sequence import last_run
from handey_studio.task.acting.performance import Performance
from handey_studio.task.calibrating.calibrate import RangeCalibration
from handey_studio.task.plan import Carry, MoveCommand, MovePlan
from handey_studio.task.sense import Scene
from handey_studio.world import Library, Robot

MAX_UNDO = 100
BUSY = "the planner is at work; cancel first or wait for it."


@dataclass(frozen=True)
class Change:
    """One undoable step: what it was called, and the settings before it."""

    label: str
    before: Settings


@dataclass(frozen=True)
class Job:
    """What the planner is doing. `execute`: whether the cell carries the plan out. A job that is no MOVE has a `title` and says with
    `done` what becomes of what comes back."""

    number: int
    execute: bool
    fraction: float = 0.0
    message: str = "Starting the planner."
    cancelling: bool = False
    title: str = ""
    done: "Callable[[State, Any], State] | None" = None


@dataclass(frozen=True)
class Notice:
    """A sentence for the user. `client` says whose browser it is for, None for everyone's."""

    number: int
    text: str
    kind: str = "info"  # info, planned, good or bad
    client: int | None = None


@dataclass(frozen=True, eq=False)
class Explained:
    """What the depth map says to hypothesis `number` of a scene; `explanation` is None when nothing can be said."""

    scene: Scene
    number: int
    explanation: Explanation | None


@dataclass(frozen=True, eq=False)
class Handled:
    """What the hand can do with a part, worked out for these arguments of `session.handling.handling`; None when that failed."""

    asked: tuple
    handling: Handling | None


@dataclass(frozen=True, eq=False)
class State:
    """Everything that the screen shows. `saved` is the session as it is on disk at `path`.

    `ledger_at` is the entry whose branches are listed, page by page, `ledger_entry` the one that is looked at; `ROOT` is none.
    `hypothesis_part`, `hypothesis_verdict` and `edge_min_m` narrow down what of the localizer's work is looked at.
    `chosen` is the place in the list of the command that is set up, -1 for the last. `calibration` is
    one that was neither accepted nor discarded yet, `outcomes` are the MOVEs carried out since the session was opened. `left_behind` is a
    working copy of an earlier run that waits for a word of the user's,
    `taken_up` whether this session is one. `dark`: whether the page is. `ruler`: the spots (3,) [m] that the
    ruler was laid to, None while it is put away.
    """

    library: Library
    session: Session
    robot: Robot
    saved: Session | None = None
    path: Path | None = None
    undo: tuple[Change, ...] = ()
    redo: tuple[Change, ...] = ()
    job: Job | None = None
    jobs: int = 0
    playing: bool = False
    speed: float = 1.0
    loop: bool = False
    dark: bool = False
    ruler: tuple[NDArray, ...] | None = None
    notices: tuple[Notice, ...] = ()
    viewers: int = 0
    ledger_stage: str = ""
    ledger_only: str = "all"
    ledger_words: str = ""
    ledger_reason: str = ""
    ledger_at: int = ROOT
    ledger_page: int = 0
    ledger_entry: int = ROOT
    hypothesis_part: str = ""
    hypothesis_verdict: str = ""
    edge_min_m: float = 0.0
    explained: Explained | None = None
    handled: Handled | None = None
    grasp_look: GraspLook = field(default_factory=GraspLook)
    model: ModelLook = field(default_factory=ModelLook)
    chosen: int = -1
    calibration: RangeCalibration | None = None
    outcomes: tuple[Outcome, ...] = ()
    left_behind: Path | None = None
    taken_up: bool = False
    loads: int = field(default=0)

    @cached_property
    def replay(self) -> Replay | None:
        """The attempt that is looked at, played over time: what really happened in it, or the plan while that is not carried out."""
        told = self.attempt
        return None if told is None else _replay(self.robot, told.plan, told.performance)

    @cached_property
    def attempts(self) -> tuple[Told, ...]:
        """All attempts of the result that is looked at."""
        return attempts_of(self.session.result) if self.session.result is not None else ()

    @cached_property
    def attempt(self) -> Told | None:
        """The one that is looked at, else the last."""
        return self.attempts[self.attempt_number] if self.attempts else None

    @property
    def attempt_number(self) -> int:
        """Its place among all, -1 where there is none."""
        count, number = len(self.attempts), self.session.view.attempt
        return number if 0 <= number < count else count - 1

    @cached_property
    def moment(self) -> Moment | None:
        """What holds at the time that is looked at."""
        return self.replay.at(self.session.view.time_s) if self.replay is not None else None

    @cached_property
    def carry(self) -> Carry | None:
        """The carry of that plan that the timeline is in."""
        return self.replay.carry_at(self.session.view.time_s) if self.replay is not None else None

    @property
    def hypothesis(self) -> Hypothesis | None:
        """The hypothesis that is looked at."""
        scene, number = self.session.scene, self.session.view.hypothesis
        known = scene.located.hypotheses if scene else ()
        return known[number] if 0 <= number < len(known) else None

    @property
    def explanation(self) -> Explanation | None:
        """What the depth map says to it, None while that is being worked out."""
        said, session = self.explained, self.session
        if said is None or said.scene is not session.scene or said.number != session.view.hypothesis:
            return None
        return said.explanation

    @property
    def entry(self) -> Entry | None:
        """The entry of the ledger that is looked at."""
        ledger = self.session.result.ledger if self.session.result else ()
        return ledger[self.ledger_entry] if 0 <= self.ledger_entry < len(ledger) else None

    @property
    def to_handle(self) -> tuple | None:
        """What it is to be worked out for how the hand can grasp it: the MOVE that is looked at, or the part that is chosen."""
        session = self.session
        command = session.result.command if session.result is not None else self.command
        part = session.part(command.part) if command is not None else None
        if part is None or command is None:
            return None
        return part, command.part, self.robot, session.workcell, session.scene, session.result

    @property
    def handling(self) -> Handling | None:
        """What the hand can do with that, None while it is being worked out."""
        return self.handled.handling if self.handled is not None and same(self.to_handle, self.handled.asked) else None

    @property
    def modelling(self) -> bool:
        """Whether the scene shows a model in the making, and not the MOVE."""
        return self.model.open and self.session.draft is not None

    @property
    def unsaved(self) -> bool:
        """Whether something worth keeping differs from the file. How one looks at it is not worth a question."""
        return self.saved is None or kept(self.saved) != kept(self.session)

    @property
    def command(self) -> MoveCommand | None:
        """The MOVE that is set up: the one of the list that is chosen."""
        return self.session.commands[self.command_number] if self.session.commands else None

    @property
    def command_number(self) -> int:
        """Its place in the list, the last unless another was chosen."""
        count = len(self.session.commands)
        return self.chosen if 0 <= self.chosen < count else count - 1

    def told(self, text: str, kind: str = "info", client: int | None = None) -> "State":
        """With one more sentence for the user."""
        number = self.notices[-1].number + 1 if self.notices else 0
        return replace(self, notices=(*self.notices[-20:], Notice(number, text, kind, client)))

    def changed(self, label: str, session: Session) -> "State":
        """With a change of the settings that can be undone. A change to what is already there is none."""
        before = Settings.of(self.session)
        if before == Settings.of(session):
            return replace(self, session=session)
        return replace(self.showing(session), undo=(*self.undo, Change(label, before))[-MAX_UNDO:], redo=())

    def showing(self, session: Session) -> "State":
        """With another session, and the robot that it names. Raises BadInput when that is unknown, or when the cell in which the planner
        is at work would become another one."""
        if self.job is not None and _cell_of(session) != _cell_of(self.session):
            raise BadInput(BUSY)
        same = session.workcell.robot == self.session.workcell.robot
        robot = self.robot if same else self.library.robot(session.workcell.robot)
        return replace(self, session=session, robot=robot, playing=self.playing and same)


def opened(library: Library, session: Session, path: Path | None, before: State | None = None) -> State:
    """The state in which a session was just opened. Raises BadInput when its robot is unknown."""
    robot = library.robot(session.workcell.robot)
    state = State(library, session, robot, saved=session if path else None, path=path, chosen=last_run(session))
    if before is None:
        return state
    here = {"viewers": before.viewers, "speed": before.speed, "left_behind": before.left_behind, "dark": before.dark}
    return replace(state, jobs=before.jobs, notices=before.notices, loads=before.loads + 1, **here)


def undone(state: State) -> State:
    """The last change taken back."""
    if not state.undo:
        return state
    change = state.undo[-1]
    forward = Change(change.label, Settings.of(state.session))
    return replace(state.showing(change.before.put_into(state.session)), undo=state.undo[:-1], redo=(*state.redo, forward))


def redone(state: State) -> State:
    """The change that was last taken back, made again."""
    if not state.redo:
        return state
    change = state.redo[-1]
    back = Change(change.label, Settings.of(state.session))
    return replace(state.showing(change.before.put_into(state.session)), undo=(*state.undo, back), redo=state.redo[:-1])


def _cell_of(session: Session) -> tuple:
    """What the cell is made of: settings that stay as they are while the planner is at work."""
    workcell = session.workcell
    return workcell.robot, id(workcell.finder), id(workcell.setup)


def with_view(state: State, **changes) -> State:
    """The state with its view changed."""
    return replace(state, session=replace(state.session, view=replace(state.session.view, **changes)))


def same(one: tuple | None, other: tuple | None) -> bool:
    """Whether two questions ask for the same: numbers and words by value, all else by identity."""
    if one is None or other is None or len(one) != len(other):
        return False
    return all(a is b or (isinstance(a, int | str) and a == b) for a, b in zip(one, other, strict=True))


@lru_cache(maxsize=8)
def _replay(robot: Robot, plan: MovePlan, performance: Performance | None) -> Replay:
    return replay_of(robot, Told(plan, performance))


def kept(session: Session) -> tuple:
    """What makes a session worth saving. Arrays are compared by identity: they never change."""
    found = id(session.scene), tuple(map(id, session.results))
    how = session.seed, session.attempts, session.improve
    return session.name, id(session.workcell), session.commands, session.states, how, id(session.draft), found
