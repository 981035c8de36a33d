"""What a user can ask of the list of MOVE commands: edit it, run it, go on where it stopped."""

from dataclasses import dataclass, replace
from typing import Any

from handey_studio.app.actions import Bench
from handey_studio.app.jobs import CANCELLED, JobStarted, at_the_end, check_idle, merged, outcome
from handey_studio.app.state import State, with_view
from handey_studio.base import BadInput
from handey_studio.session import Session
from handey_studio.session.command_list import with_commands
from handey_studio.session.destination import anywhere
from handey_studio.session.sequence import from_the_start, last_run, next_command, run_list, skipped, states_of
from handey_studio.task.plan import MoveCommand
from handey_studio.world import Library


@dataclass(frozen=True)
class ChooseCommand:
    """Set up this command of the list, and look at what became of it."""

    number: int

    def apply(self, state: State) -> State:
        if not 0 <= self.number < len(state.session.commands):
            return state
        state = replace(state, chosen=self.number)
        result = states_of(state.session)[self.number].result
        return with_view(state, result=result, attempt=0, time_s=0.0) if result >= 0 else state


@dataclass(frozen=True)
class AddCommand:
    """One more command below the chosen one: the next part that none speaks of, to anywhere on the table."""

    def apply(self, state: State) -> State:
        session = state.session
        if not session.workcell.parts:
            raise BadInput("this workcell has no part models; nothing can be moved in it.")
        at = state.command_number + 1
        new = MoveCommand(_unspoken(session), anywhere(session))
        state = _edited(state, "add command", (*session.commands[:at], new, *session.commands[at:]))
        return replace(state, chosen=at)


@dataclass(frozen=True)
class RemoveCommand:
    def apply(self, state: State) -> State:
        if len(state.session.commands) < 2:
            raise BadInput("the list has only this command; edit it instead.")
        at, commands = state.command_number, state.session.commands
        state = _edited(state, "remove command", (*commands[:at], *commands[at + 1 :]))
        return replace(state, chosen=min(at, len(commands) - 2))


@dataclass(frozen=True)
class ShiftCommand:
    """The chosen command a place up (-1) or down (+1)."""

    by: int

    def apply(self, state: State) -> State:
        at, commands = state.command_number, list(state.session.commands)
        to = at + self.by
        if not (0 <= at < len(commands) and 0 <= to < len(commands)):
            return state
        commands[at], commands[to] = commands[to], commands[at]
        return replace(_edited(state, "move command up" if self.by < 0 else "move command down", tuple(commands)), chosen=to)


@dataclass(frozen=True)
class SkipCommand:
    """The chosen command is passed over, or no longer."""

    def apply(self, state: State) -> State:
        check_idle(state)
        number, states = state.command_number, list(states_of(state.session))
        if number < 0:
            return state
        if states[number].status != "skipped":
            return replace(state, session=skipped(state.session, number))
        states[number] = type(states[number])()
        return replace(state, session=replace(state.session, states=tuple(states)))


@dataclass(frozen=True)
class StartOver:
    """All commands wait again; the cell stays as it is."""

    def apply(self, state: State) -> State:
        check_idle(state)
        return replace(with_view(state, result=-1, attempt=-1, time_s=0.0), session=from_the_start(state.session), playing=False)


@dataclass(frozen=True)
class RunCommands:
    """All commands from the first that is not over, or only that one."""

    step: bool = False

    def run(self, bench: Bench) -> State:
        state = bench.state
        check_idle(state)
        if next_command(state.session) is None:
            raise BadInput("every command is done or skipped; press Start over, or add one.")
        job = JobStarted(True, "Running the next command" if self.step else "Running the commands", commands_done)
        state = job.apply(state)
        bench.planner.order(state.jobs, state.session, state.library, True, run_next if self.step else run_all)
        return state


def run_all(session: Session, library: Library, execute: bool, progress: Any) -> Session:
    """In the planner's process: every command that is not over."""
    return run_list(session, library, progress)


def run_next(session: Session, library: Library, execute: bool, progress: Any) -> Session:
    """In the planner's process: the first command that is not over."""
    return run_list(session, library, progress, most=1)


def commands_done(state: State, found: Session) -> State:
    """The state when a run has ended: the command that was run last is chosen, and its end looked at."""
    state = replace(state, session=merged(state.session, found))
    states, cancelled = states_of(state.session), bool(found.results) and found.results[-1].reason == CANCELLED
    state = at_the_end(replace(state, chosen=last_run(state.session)))
    over = sum(one.status in ("done", "skipped") for one in states)
    if over == len(states):
        return state.told(f"All {len(states)} commands are done.", "good")
    if cancelled:
        return state.told(f"Stopped: {over} of {len(states)} commands are done. Run goes on from there.")
    failed = next((k for k, one in enumerate(states) if one.status == "failed"), None)
    if failed is None:
        return state.told(f"{over} of {len(states)} commands are done.", "good")
    return state.told(f"Command {failed + 1} of {len(states)}: {outcome(state.session.results[states[failed].result])}", "bad")


def _edited(state: State, label: str, commands: tuple[MoveCommand, ...]) -> State:
    check_idle(state)
    return with_view(state.changed(label, with_commands(state.session, commands)), hypothesis=-1)


def _unspoken(session: Session) -> str:
    """An instance, else a part, that no command speaks of; the first part when all are spoken of."""
    spoken = {command.part for command in session.commands}
    names = [*(placed.name for placed in session.located if "#" in placed.name), *session.workcell.parts]
    return next((name for name in names if name not in spoken), session.workcell.parts[0])
