"""`handey robot list`: the robots of the library."""

import argparse

from handey_studio.commands.arguments import DONE

NAME = "robot list"
HELP = "the robots of the library, each with its joints and its folder"


def add_arguments(listing: argparse.ArgumentParser) -> None:
    """None of its own."""


def run(given: argparse.Namespace) -> int:
    from handey_studio.world import Library, load_robot

    for name, folder in sorted(Library.choose(given.library).robot_folders().items()):
        robot = load_robot(folder)
        held = f", {len(robot.held_joints)} of them held" if robot.held_joints else ""
        print(f"{name:10} {len(robot.joint_names)} joints{held}, ik {robot.ik}, hand to {1e3 * robot.hand.opening_max:.0f} mm: {folder}")
    return DONE
