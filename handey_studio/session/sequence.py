"""A session's commands as a list that is run: all of them, one at a time, and on from where it stopped.

A command that cannot be planned is postponed, and comes back when others changed the pile: what lay on its part may be gone. Only what
needs it waits with it.
"""

from collections import Counter
from dataclasses import replace

from handey_studio.base import Share
from handey_studio.cell.protocol import Cell
from handey_studio.cell.simulated import SimulatedCell
from handey_studio.session.run import ShowingProgress, cell_of, known_of, move_options, recovery_options, station_of
from handey_studio.session.session import CommandState, Session
from handey_studio.task import Outcome, Scene, Station, check_command, run_move
from handey_studio.task.destination import base_name
from handey_studio.world import Library

OVER = ("done", "skipped")
WAITING = CommandState()


def states_of(session: Session) -> tuple[CommandState, ...]:
    """How far each command is, one state each. A command that was changed since it was run waits; so does one that was interrupted."""
    known = (*session.states, *[WAITING] * len(session.commands))
    return tuple(_valid(session, number, state) for number, state in zip(range(len(session.commands)), known, strict=False))


def next_command(session: Session) -> int | None:
    """The number of the command that a run takes next, None if there is none: the first that is not over, and when all had their turn, the
    first of the postponed, if anything was done since."""
    states = states_of(session)
    left = [number for number, state in enumerate(states) if state.status not in OVER]
    ready = [number for number in left if not any(_needs(session, number, other) for other in left if other < number)]
    done = max((state.result for state in states if state.status == "done"), default=-1)
    first = [number for number in ready if states[number].status != "postponed"]
    again = [number for number in ready if states[number].status == "postponed" and states[number].result < done]
    return next(iter([*first, *again]), None)


def last_run(session: Session) -> int:
    """The number of the command that the session's last result belongs to, -1 if it belongs to none of the list."""
    last = len(session.results) - 1
    return next((number for number, state in enumerate(states_of(session)) if state.result == last >= 0), -1)


def skipped(session: Session, number: int) -> Session:
    """The session in which a command is passed over."""
    return _with_state(session, number, CommandState("skipped"))


def from_the_start(session: Session) -> Session:
    """The session with all its commands waiting; what was executed stays as it is in the cell."""
    return replace(session, states=(), results=())


def run_list(
    session: Session,
    library: Library,
    progress: ShowingProgress,
    most: int | None = None,
    go_on: bool = False,
) -> Session:
    """Run the session's commands that are not over: all of them, or at most `most` (1 is a step).

    One that cannot be planned is postponed, and failed when nothing that is done helps it. One that goes wrong in the cell ends the run, or
    with `go_on` is postponed too. Cancelled, the command that was running waits again. Shows the session with each new state. Raises
    BadInput for a command that means nothing here, before anything moves.
    """
    station, cell = station_of(session, library), cell_of(session, library)
    for command, state in zip(session.commands, states_of(session), strict=True):
        if state.status not in OVER:
            check_command(command, station.models)
    after, ran = None, 0
    while ran != most and (number := next_command(session)) is not None:
        session = _with_state(session, number, CommandState("running"))
        progress.show(session)
        over = sum(state.status in OVER for state in states_of(session))
        share = Share(progress, over / len(session.commands), (over + 1) / len(session.commands))
        outcome = _one(session, number, station, cell, after, share)
        after, ran = outcome.after, ran + 1
        session = _with_outcome(session, number, outcome, cell, go_on)
        status = states_of(session)[number].status
        if progress.cancelled:
            return _with_state(session, number, WAITING) if status != "done" else session
        progress.show(session)
        if status == "failed":
            break
    return session if next_command(session) is not None else _given_up(session)


def _one(session: Session, number: int, station: Station, cell: Cell, scene: Scene | None, progress: Share) -> Outcome:
    """One command; the scene that was seen after the one before serves, if nothing moved since."""
    options, recovery = replace(move_options(session), settled=_settled(session, number)), recovery_options(session)
    known = known_of(session)
    return run_move(station, cell, session.commands[number], options, progress=progress, recovery=recovery, scene=scene, known=known)


def _settled(session: Session, number: int) -> tuple[tuple[str, float, float, float], ...]:
    """Where the commands that are done put their parts: a later command means another one, if there were ever several of the kind."""
    counts = Counter(placed.part.name for placed in session.located)
    found = []
    for k, state in enumerate(states_of(session)):
        T = session.results[state.result].T_world_part_reached if state.status == "done" and k != number else None
        if T is not None and counts[base_name(session.commands[k].part)] > 1:
            found.append((base_name(session.commands[k].part), *T[:3, 3].tolist()))
    return tuple(found)


def _needs(session: Session, number: int, earlier: int) -> bool:
    """Whether a command means the same part as an earlier one, or puts its own on that part: then it comes after it."""
    command, other = session.commands[number], session.commands[earlier]
    kind = base_name(other.part)
    if command.to.startswith("on:") and base_name(command.to.split(":")[1]) == kind:
        return True
    several = sum(placed.part.name == kind for placed in session.located) > 1
    return command.part == other.part and (other.part != kind or not several)


def _with_outcome(session: Session, number: int, outcome: Outcome, cell: SimulatedCell, go_on: bool) -> Session:
    """The session after a command: its result is the one that is looked at."""
    result = outcome.result
    results = (*session.results, result)
    status = "done" if result.status == "done" else "postponed" if go_on or not result.performances else "failed"
    view = replace(session.view, result=-1, time_s=0.0, hypothesis=-1, edge=-1)
    session = replace(session, scene=outcome.scene or session.scene, results=results, cell_now=cell.setup_now(), view=view)
    return _with_state(session, number, CommandState(status, len(results) - 1))


def _given_up(session: Session) -> Session:
    """The session when no command can have a turn: what is postponed has failed."""
    if all(state.status != "postponed" for state in session.states):
        return session
    states = (replace(state, status="failed") if state.status == "postponed" else state for state in states_of(session))
    return replace(session, states=tuple(states))


def _with_state(session: Session, number: int, state: CommandState) -> Session:
    states = list(states_of(session))
    states[number] = state
    return replace(session, states=tuple(states))


def _valid(session: Session, number: int, state: CommandState) -> CommandState:
    if state.result < 0:
        return WAITING if state.status in ("done", "failed", "postponed") else state
    mine = session.results[state.result] if state.result < len(session.results) else None
    return state if mine is not None and mine.command == session.commands[number] else WAITING
