"""`handey move`: run a session's MOVEs."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from handey_studio.base import BadInput, Entry, describe
from handey_studio.commands.arguments import DONE, FAILED, Lines, check_output, write_json
from handey_studio.world import Library

if TYPE_CHECKING:
    from handey_studio.session import Session
    from handey_studio.task import MoveCommand, MoveResult

NAME = "move"
HELP = "run a session's MOVEs: sense, plan, execute"


def add_arguments(move: argparse.ArgumentParser) -> None:
    move.add_argument("session", help="a session file, or its name in a library")
    move.add_argument("--part", help="move this part instead of running the session's own commands")
    move.add_argument("--to", metavar="DESTINATION", help="x,y,z[,roll,pitch,yaw] (metres, degrees), on:PART[:POSE] or in:x0,y0,x1,y1")
    move.add_argument("--robot", help="a robot of the library, or a folder with a robot.toml, instead of the session's own")
    move.add_argument("--seed", type=int, help="instead of the session's own seed")
    move.add_argument("--json", type=Path, help="where the steps, the certificate and the ledger go")
    move.add_argument("--save", type=Path, metavar="SESSION2", help="where the session with its results goes")


def run(given: argparse.Namespace) -> int:
    return run_moves(given, execute=True)


def run_moves(given: argparse.Namespace, execute: bool) -> int:
    from handey_studio.session import find_session, read_session, write_session
    from handey_studio.session.run import cell_of, station_of
    from handey_studio.task import MoveOptions, run_move
    from handey_studio.task.report import move_report

    for output in (given.json, given.save):
        check_output(output)
    library = Library.choose(given.library)
    session = read_session(find_session(library, given.session))
    if given.robot is not None:
        session = replace(session, workcell=replace(session.workcell, robot=given.robot))
    commands = _commands(given, session)
    seed = session.seed if given.seed is None else given.seed
    station, cell = station_of(session, library), cell_of(session, library)
    results, scene = [], None
    for command in commands:
        scene, result = run_move(station, cell, command, MoveOptions(seed=seed), execute, Lines())
        results.append(result)
        _tell(result)
        if result.status == "failed":
            break
    if given.json:
        write_json(given.json, move_report(results, station.robot))
    if given.save:
        now = cell.setup_now() if execute else session.cell_now
        write_session(given.save, replace(session, commands=commands, seed=seed, scene=scene, results=tuple(results), cell_now=now))
    return DONE if len(results) == len(commands) and all(result.status != "failed" for result in results) else FAILED


def _commands(given: argparse.Namespace, session: "Session") -> "tuple[MoveCommand, ...]":
    from handey_studio.task import MoveCommand

    if (given.part is None) != (given.to is None):
        raise BadInput("--part and --to go together: MOVE part TO destination.")
    if given.part is not None:
        return (MoveCommand(given.part, given.to),)
    if not session.commands:
        raise BadInput(f'session "{session.name}" has no commands; give --part and --to.')
    return session.commands


def _tell(result: "MoveResult") -> None:
    stages = ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in result.timing_s.items())
    print(f"MOVE {result.command.part} TO {result.command.to}: {result.status}{': ' + result.reason if result.reason else ''}")
    print(f"  {stages}")
    if result.plan is not None:
        certificate = result.plan.certificate
        clearance = f"{1e3 * certificate.least_clearance:.1f} mm ({' and '.join(certificate.bodies)})"
        grasps = "; then ".join(carry.grasp.group for carry in result.plan.carries)
        print(f"  grasp: {grasps}; least clearance {clearance}")
    elif result.ledger:
        print(f"  {len(result.ledger)} options in the ledger; the last: {_last_reason(result.ledger)}")


def _last_reason(entries: tuple[Entry, ...]) -> str:
    return next((f"{entry.stage} {entry.option}: {describe(entry)}" for entry in reversed(entries) if entry.reason), "none fell")
