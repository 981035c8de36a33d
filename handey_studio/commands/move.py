"""`handey move`: run a session's MOVEs."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from handey_studio.base import BadInput, Entry, describe
from handey_studio.commands.arguments import DONE, FAILED, Lines, check_output, positive, whole, write_json

if TYPE_CHECKING:
    from handey_studio.session import Session
    from handey_studio.task import MoveCommand, MoveResult
    from handey_studio.world import Library

NAME = "move"
HELP = "run a session's MOVEs: sense, plan, execute"
FIRST = "The first run on a machine compiles its numerical code: a minute or two, once."


def add_arguments(move: argparse.ArgumentParser) -> None:
    add_common(move)
    move.add_argument("--resume", action="store_true", help="go on where the saved session stopped: what is done is not done again")
    move.add_argument("--step", action="store_true", help="only the next command")
    move.add_argument("--go-on", action="store_true", help="postpone a command that went wrong in the cell too, instead of ending there")
    move.add_argument(
        "--attempts", type=positive, help="how often a MOVE is tried, the first time among them, instead of the session's own"
    )
    move.add_argument("--recordings", action="store_true", help="what was measured goes into the JSON too")


def add_common(move: argparse.ArgumentParser) -> None:
    """What `move` and `plan` share."""
    move.add_argument("session", help="a session file, or its name in a library")
    move.add_argument("--part", help="move this part instead of running the session's own commands")
    move.add_argument("--to", metavar="DESTINATION", help="x,y,z[,roll,pitch,yaw] (metres, degrees), on:PART[:POSE] or in:x0,y0,x1,y1")
    move.add_argument("--robot", help="a robot of the library, or a folder with a robot.toml, instead of the session's own")
    move.add_argument("--seed", type=int, help="instead of the session's own seed")
    move.add_argument("--improve", type=whole, metavar="N", help="look at N more plans once there is one, and take the best")
    move.add_argument("--json", type=Path, help="where the steps, the certificate and the ledger go")
    move.add_argument("--save", type=Path, metavar="SESSION2", help="where the session with its results goes")


def run(given: argparse.Namespace) -> int:
    from handey_studio.session.sequence import from_the_start, run_list, states_of

    session, library = opened(given)
    if not given.resume:
        session = from_the_start(session)
    earlier, watching = len(session.results), Watching()
    session = replace(session, attempts=given.attempts or session.attempts)
    session = run_list(session, library, watching, 1 if given.step else None, given.go_on)
    states = states_of(session)
    for number, (command, state) in enumerate(zip(session.commands, states, strict=True), 1):
        if len(states) > 1:
            print(f"{number:3d} {state.status:9} MOVE {command.part} TO {command.to}")
    write_outputs(given, session, library, session.results[earlier:])
    return DONE if all(state.status in ("done", "skipped") for state in states) else FAILED


class Watching(Lines):
    """Tells each result as it comes."""

    def __init__(self) -> None:
        self._told = 0

    def show(self, session: "Session") -> None:
        for result in session.results[max(self._told, 0) :]:
            if result.status != "planned":
                tell(result)
        self._told = len(session.results)


def opened(given: argparse.Namespace) -> "tuple[Session, Library]":
    """The session that is asked for, with the commands, robot and seed that are given."""
    from handey_studio.motion import warm_up
    from handey_studio.session import find_session, read_session
    from handey_studio.session.ahead import compile_beside
    from handey_studio.world import Library

    for output in (given.json, given.save):
        check_output(output)
    library = Library.choose(given.library)
    session = read_session(find_session(library, given.session))
    if given.robot is not None:
        session = replace(session, workcell=replace(session.workcell, robot=given.robot))
    seed = session.seed if given.seed is None else given.seed
    improve = session.improve if given.improve is None else given.improve
    session = replace(session, commands=_commands(given, session), seed=seed, improve=improve)
    if compile_beside(warm_up, library.robot(session.workcell.robot)) and sys.stderr.isatty():
        print(FIRST, file=sys.stderr)
    return session, library


def write_outputs(given: argparse.Namespace, session: "Session", library: "Library", results: "Sequence[MoveResult]") -> None:
    """The JSON and the session, where they are asked for."""
    from handey_studio.session import write_session
    from handey_studio.task.report import move_report

    if given.json:
        robot = library.robot(session.workcell.robot)
        write_json(given.json, move_report(list(results), robot, getattr(given, "recordings", False)))
    if given.save:
        write_session(given.save, session)


def _commands(given: argparse.Namespace, session: "Session") -> "tuple[MoveCommand, ...]":
    from handey_studio.task import MoveCommand

    if (given.part is None) != (given.to is None):
        raise BadInput("--part and --to go together: MOVE part TO destination.")
    if given.part is not None:
        return (MoveCommand(given.part, given.to),)
    if not session.commands:
        raise BadInput(f'session "{session.name}" has no commands; give --part and --to.')
    return session.commands


def tell(result: "MoveResult") -> None:
    """A result on standard output."""
    stages = ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in result.timing_s.items())
    print(f"MOVE {result.command.part} TO {result.command.to}: {result.status}{': ' + result.reason if result.reason else ''}")
    print(f"  {stages}")
    for number, attempt in enumerate(result.attempts, 1):
        recovery = attempt.recovery
        print(f"  attempt {number}: {recovery.incident}; {'; '.join((*recovery.actions, recovery.why))}")
    if result.check is not None:
        print(f"  check: {result.check.sentence}")
    if result.plan is not None:
        certificate = result.plan.certificate
        clearance = f"{1e3 * certificate.least_clearance:.1f} mm ({' and '.join(certificate.bodies)})"
        grasps = "; then ".join(carry.grasp.group for carry in result.plan.carries)
        print(f"  grasp: {grasps}; least clearance {clearance}")
    elif result.ledger:
        print(f"  {len(result.ledger)} options in the ledger; the last: {_last_reason(result.ledger)}")


def _last_reason(entries: tuple[Entry, ...]) -> str:
    return next((f"{entry.stage} {entry.option}: {describe(entry)}" for entry in reversed(entries) if entry.reason), "none fell")
