"""`handey plan`: MOVEs that stop before executing."""

import argparse
from dataclasses import replace

from handey_studio.commands.arguments import DONE, FAILED, Lines
from handey_studio.commands.move import add_common, opened, tell, write_outputs

NAME = "plan"
HELP = "sense and plan a session's MOVEs, execute nothing"

add_arguments = add_common


def run(given: argparse.Namespace) -> int:
    from handey_studio.session.run import cell_of, move_options, station_of
    from handey_studio.task import run_move

    session, library = opened(given)
    station, cell = station_of(session, library), cell_of(session, library)
    results = []
    for command in session.commands:
        outcome = run_move(station, cell, command, move_options(session), False, Lines())
        session = replace(session, scene=outcome.scene, results=(*results, outcome.result), states=())
        results.append(outcome.result)
        tell(outcome.result)
        if outcome.result.status == "failed":
            break
    write_outputs(given, session, library, results)
    return DONE if len(results) == len(session.commands) and all(result.status != "failed" for result in results) else FAILED
