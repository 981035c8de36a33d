"""What the planner says, as commands: it started, got on, has something to show, is done, or failed."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from handey_studio.app.compared import with_outcome
from handey_studio.app.state import BUSY, Job, State, with_view
from handey_studio.app.wording import move_words
from handey_studio.base import BadInput
from handey_studio.session import CommandState, Session
from handey_studio.session.ledger_tree import ROOT
from handey_studio.session.sequence import states_of
from handey_studio.task.plan import MoveResult

KINDS = {"planned": "planned", "done": "good", "failed": "bad"}  # of notices
FIRST_JOB = "Starting the planner. The first time after an installation its code is compiled: a minute or two, once."
CANCELLED = "cancelled"  # the reason that a planner gives when it was told to stop


def check_idle(state: State) -> None:
    """Raises BadInput while the planner is at work."""
    if state.job is not None:
        raise BadInput(BUSY)


@dataclass(frozen=True)
class JobProgress:
    number: int
    fraction: float
    message: str

    def apply(self, state: State) -> State:
        if state.job is None or state.job.number != self.number:
            return state
        return replace(state, job=replace(state.job, fraction=max(state.job.fraction, self.fraction), message=self.message))


@dataclass(frozen=True, eq=False)
class JobShows:
    """The planner has something to show before it is done: the session with what was found so far."""

    number: int
    session: Session

    def apply(self, state: State) -> State:
        if state.job is None or state.job.number != self.number:
            return state
        grown = bool(self.session.states) and len(self.session.results) > len(state.session.results)
        state = replace(state, session=merged(state.session, self.session), playing=False)
        return at_the_end(state) if grown else state


@dataclass(frozen=True, eq=False)
class JobDone:
    """The planner is through; the result of a MOVE plays from its start."""

    number: int
    session: Any

    def apply(self, state: State) -> State:
        if state.job is None or state.job.number != self.number:
            return state
        if state.job.done is not None:
            return state.job.done(replace(state, job=None), self.session)
        session, executed = merged(state.session, self.session), state.job.execute
        state = replace(state, session=session, job=None, ledger_at=ROOT, ledger_page=0, ledger_entry=ROOT, ledger_reason="")
        state = with_view(state, time_s=0.0, result=-1, attempt=0)
        result = session.result
        if result is None:
            return state
        state = with_outcome(state) if executed and result.reason != CANCELLED else state
        kind = KINDS[result.status] if result.reason != CANCELLED else "info"
        return replace(state, playing=state.replay is not None).told(outcome(result), kind)


@dataclass(frozen=True)
class JobFailed:
    """The planner could not start on this, or broke down; the sentence says which."""

    number: int
    sentence: str

    def apply(self, state: State) -> State:
        if state.job is None or state.job.number != self.number:
            return state
        return replace(state, job=None).told(self.sentence, "bad")


@dataclass(frozen=True)
class JobStarted:
    """`title` and `done` as in `Job`."""

    execute: bool
    title: str = ""
    done: Callable[[State, Any], State] | None = None

    def apply(self, state: State) -> State:
        job = Job(state.jobs + 1, self.execute, title=self.title, done=self.done)
        job = replace(job, message=FIRST_JOB) if job.number == 1 else job
        return replace(state, jobs=state.jobs + 1, playing=False, job=job)


def at_the_end(state: State) -> State:
    """Looking at the end of the last result's last attempt, where the cell is now."""
    state = with_view(state, result=-1, attempt=-1)
    return with_view(state, time_s=state.replay.duration if state.replay is not None else 0.0)


def merged(shown: Session, found: Session) -> Session:
    """What the planner found put into the session on screen, whose settings may have changed meanwhile.

    A scene that came once more stays the one that is shown; of a new one nothing is looked at yet.
    """
    results, states = (found.results, found.states) if found.states else _beside(shown, found)
    shown = replace(shown, results=results, states=states, cell_now=found.cell_now)
    if found.scene == shown.scene:
        return shown
    return replace(shown, scene=found.scene, view=replace(shown.view, hypothesis=-1, edge=-1))


def _beside(shown: Session, found: Session) -> tuple[tuple[MoveResult, ...], tuple[CommandState, ...]]:
    """What came of a single command, put to the results of a list that is being run, if one is."""
    kept = shown.results[: 1 + max((state.result for state in shown.states), default=-1)]
    states, last = list(states_of(shown)), found.results[-1] if found.results else None
    if last is not None and last.performances and last.command in shown.commands:
        done = CommandState("done" if last.status == "done" else "failed", len(kept) + len(found.results) - 1)
        states[shown.commands.index(last.command)] = done
    begun = any(state.result >= 0 or state.status == "skipped" for state in states)
    return (*kept, *found.results), tuple(states) if begun else ()


def outcome(result: MoveResult) -> str:
    """One sentence about a result."""
    what = move_words(result.command)
    if result.reason == CANCELLED:
        return f"{what} was cancelled."
    if result.status == "failed":
        return f"{what} failed: {result.reason}"
    steps = result.plan.steps if result.plan else ()
    seconds = sum(float(step.time_s[-1]) for step in steps)
    return f"{what} is {'done' if result.status == 'done' else 'planned'}: {len(steps)} steps, {seconds:.1f} s."
