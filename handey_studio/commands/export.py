"""`handey export`: a planned MOVE for a robot controller."""

import argparse
from pathlib import Path

from handey_studio.base import BadInput
from handey_studio.base.files import replace_file
from handey_studio.commands.arguments import DONE, check_output

NAME = "export"
HELP = "write a planned MOVE for a robot controller, after a dry check against the robot's limits"
SUFFIXES = {"urscript": ".script", "ros2": ".ros2.json", "csv": ".csv"}


def add_arguments(export: argparse.ArgumentParser) -> None:
    export.add_argument("move", type=Path, metavar="MOVE.json", help="what handey plan or handey move wrote with --json")
    export.add_argument("--format", required=True, choices=sorted(SUFFIXES), help="urscript (servoj), ros2 (JointTrajectory) or csv")
    export.add_argument("--out", type=Path, help="where it goes (default: beside MOVE.json); ros2 writes YAML to .yaml, else JSON")
    export.add_argument(
        "--rate", type=float, metavar="HZ", help="samples a second: 125 or 500 for urscript (default 125), else the plan's own"
    )
    export.add_argument("--robot", help="a robot of the library, or a folder with a robot.toml, if it is not found by the plan's name")


def run(given: argparse.Namespace) -> int:
    from handey_studio.task.export import program_text, read_program
    from handey_studio.world import Library

    out = given.out or given.move.with_suffix(SUFFIXES[given.format])
    check_output(out)
    program = read_program(given.move)
    robot = Library.choose(given.library).robot(given.robot or program.robot)
    form = "ros2-yaml" if given.format == "ros2" and out.suffix in (".yaml", ".yml") else given.format
    text, program = program_text(program, robot, form, given.rate)
    try:
        replace_file(out, text.encode())
    except OSError as error:
        raise BadInput(f'"{out}" cannot be written: {error.strerror}.') from None
    samples = sum(len(step.time_s) for step in program.steps)
    print(f"{out}: {len(program.steps)} steps, {samples} samples, {program.duration:.1f} s, within the limits of {robot.name}")
    return DONE
