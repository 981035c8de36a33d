"""One MOVE of a session, from the scan to the executed plan: what the workbench's planner process runs."""

from dataclasses import replace
from typing import Protocol

from handey_studio.base import BadInput, Progress, Share
from handey_studio.cell.protocol import CannotAct
from handey_studio.cell.simulated import SimulatedCell, simulated_cell
from handey_studio.session.session import Session
from handey_studio.task import (
    MoveOptions,
    MoveResult,
    Order,
    RecoveryOptions,
    SearchOptions,
    Station,
    carry_out,
    check_command,
    plan_in,
    sense,
)
from handey_studio.task.remembering import known_after
from handey_studio.world import Library, PlacedPart

SENSED, PLANNED = 0.25, 0.6  # how much of a whole MOVE's progress is behind when it is sensed, and when it is planned


class ShowingProgress(Progress, Protocol):
    """Progress that can also show what was found so far."""

    def show(self, session: Session) -> None: ...


def run_session(session: Session, library: Library, execute: bool, progress: ShowingProgress) -> Session:
    """Sense, plan and, if asked, execute the session's last MOVE in its cell; the session with all that was found.

    A plan that was made for this MOVE and looked at is carried out as it is. Nothing found is a result in the session, not an
    exception. Raises BadInput for a command that means nothing here.
    """
    if not session.commands:
        raise BadInput(f'session "{session.name}" has no MOVE; choose a part and a destination.')
    command, station = session.commands[-1], station_of(session, library)
    check_command(command, station.models)
    cell = cell_of(session, library)
    if not (execute and is_planned(session)):
        session = _sensed_and_planned(session, station, cell, progress)
        if execute and is_planned(session):
            progress.show(session)
    if not execute or not is_planned(session) or progress.cancelled:
        return session
    return _executed(session, station, cell, progress)


def is_planned(session: Session) -> bool:
    """Whether what the session shows is a plan for its last MOVE that was not carried out yet."""
    result = session.results[-1] if session.results else None
    return session.scene is not None and result is not None and result.status == "planned" and result.command == session.commands[-1]


def _sensed_and_planned(session: Session, station: Station, cell: SimulatedCell, progress: ShowingProgress) -> Session:
    command = session.commands[-1]
    try:
        scene = sense(station, cell, session.seed, Share(progress, 0.0, SENSED), known_of(session))
    except CannotAct as error:
        return replace(session, scene=None, results=(MoveResult(command, "failed", str(error)),))
    session = replace(session, scene=scene, results=())
    progress.show(session)
    start = cell.joints(), cell.opening()
    result = plan_in(station, scene, command, *start, move_options(session), Share(progress, SENSED, PLANNED))
    return replace(session, results=(result,))


def _executed(session: Session, station: Station, cell: SimulatedCell, progress: ShowingProgress) -> Session:
    """The scene of a session is the one that its plan was made in: a recovery may have made a new one."""
    if session.scene is None:
        return session
    planned = session.results[-1]
    order = Order(station, planned.command, move_options(session), recovery_options(session))
    outcome = carry_out(order, session.scene, planned, cell, Share(progress, PLANNED, 1.0))
    return replace(session, scene=outcome.scene, results=(outcome.result,), cell_now=cell.setup_now())


def known_of(session: Session) -> tuple[PlacedPart, ...]:
    """Where the parts are by all that the session saw and did: what the last scene told, and what its last result put elsewhere."""
    result = session.results[-1] if session.results else None
    if session.scene is None:
        return ()
    if result is None or result.plan is None or result.performance is None:
        return session.scene.instances
    return known_after(session.scene, result.plan.part, result.T_world_part_reached)


def move_options(session: Session) -> MoveOptions:
    """How the session's MOVEs are planned."""
    return MoveOptions(seed=session.seed, search=SearchOptions(improve=session.improve))


def recovery_options(session: Session) -> RecoveryOptions:
    """How often they are tried."""
    return RecoveryOptions(attempts=session.attempts)


def station_of(session: Session, library: Library) -> Station:
    """The session's workcell with its robot and its own part models."""
    return Station(session.workcell, library.robot(session.workcell.robot), session.parts)


def cell_of(session: Session, library: Library) -> SimulatedCell:
    """The simulated cell as the session's last execution left it."""
    workcell = session.workcell
    return simulated_cell(workcell if session.cell_now is None else replace(workcell, setup=session.cell_now), library)
