"""`handey plan`: MOVEs that stop before executing."""

import argparse

from handey_studio.commands import move

NAME = "plan"
HELP = "sense and plan a session's MOVEs, execute nothing"

add_arguments = move.add_arguments


def run(given: argparse.Namespace) -> int:
    return move.run_moves(given, execute=False)
