"""A session's commands as a list that is run: all of them, one at a time, and on from where it stopped."""

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
    """The number of the first command that is not over, None if all are: there a run goes on."""
    return next((number for number, state in enumerate(states_of(session)) if state.status not in OVER), None)


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
    """Run the session's commands from the first that is not over: all of them, or at most `most` (1 is a step).

    A command that fails ends the run, or with `go_on` the next one is taken. Cancelled, the command that was running waits again. Shows the
    session with each new state. Raises BadInput for a command that means nothing here, before anything moves.
    """
    station, cell = station_of(session, library), cell_of(session, library)
    wanted = [number for number, state in enumerate(states_of(session)) if state.status not in OVER][:most]
    for number in wanted:
        check_command(session.commands[number], station.models)
    after = None
    for count, number in enumerate(wanted):
        session = _with_state(session, number, CommandState("running"))
        progress.show(session)
        share = Share(progress, count / len(wanted), (count + 1) / len(wanted))
        outcome = _one(session, number, station, cell, after, share)
        after = outcome.after
        session = _with_outcome(session, number, outcome, cell)
        undone = states_of(session)[number].status != "done"
        if progress.cancelled:
            return _with_state(session, number, WAITING) if undone else session
        progress.show(session)
        if undone and not go_on:
            break
    return session


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


def _with_outcome(session: Session, number: int, outcome: Outcome, cell: SimulatedCell) -> Session:
    """The session after a command: its result is the one that is looked at."""
    results = (*session.results, outcome.result)
    status = "done" if outcome.result.status == "done" else "failed"
    view = replace(session.view, result=-1, time_s=0.0, hypothesis=-1, edge=-1)
    session = replace(session, scene=outcome.scene or session.scene, results=results, cell_now=cell.setup_now(), view=view)
    return _with_state(session, number, CommandState(status, len(results) - 1))


def _with_state(session: Session, number: int, state: CommandState) -> Session:
    states = list(states_of(session))
    states[number] = state
    return replace(session, states=tuple(states))


def _valid(session: Session, number: int, state: CommandState) -> CommandState:
    if state.result < 0:
        return WAITING if state.status in ("done", "failed") else state
    mine = session.results[state.result] if state.result < len(session.results) else None
    return state if mine is not None and mine.command == session.commands[number] else WAITING
