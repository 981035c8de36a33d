"""`handey robot check`: what is wrong with a robot folder, and what is right."""

import argparse
from pathlib import Path

from handey_studio.commands.arguments import BAD_INPUT, DONE

NAME = "robot check"
HELP = "what is wrong with a robot folder, one sentence a finding, and what is right"


def add_arguments(check: argparse.ArgumentParser) -> None:
    check.add_argument("robot", metavar="DIR", help="a folder with a robot.toml, or a robot of the library by name")


def run(given: argparse.Namespace) -> int:
    from handey_studio.world import Library
    from handey_studio.world.robot_check import check_robot

    named = Library.choose(given.library).robot_folders()
    folder = Path(given.robot) if Path(given.robot).is_dir() else named.get(given.robot, Path(given.robot))
    report = check_robot(folder)
    for kind, sentences in (("wrong", report.wrong), ("note", report.notes), ("right", report.right)):
        for sentence in sentences:
            print(f"{kind}: {sentence}")
    print(f"{folder.name}: {f'{len(report.wrong)} wrong' if report.wrong else 'nothing wrong'}, {len(report.notes)} to look at.")
    return BAD_INPUT if report.wrong else DONE
