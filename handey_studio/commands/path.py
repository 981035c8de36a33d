"""`handey path`: a certified path between two configurations in a MoveIt scene."""

import argparse
import sys
from pathlib import Path

import numpy as np

from handey_studio.commands.arguments import DONE, NOTHING_FOUND, Lines, check_output, write_json

NAME = "path"
HELP = "a certified path between two configurations in a scene of boxes, cylinders and spheres (MoveIt's YAML)"


def add_arguments(path: argparse.ArgumentParser) -> None:
    path.add_argument("--robot", required=True, help="a robot of the library, or a folder with a robot.toml")
    path.add_argument(
        "--scene", required=True, type=Path, metavar="S.yaml", help="world.collision_objects, in the frame of the robot's base"
    )
    path.add_argument("--request", required=True, type=Path, metavar="Q.yaml", help="start_state and goal_constraints: joint angles")
    path.add_argument("--json", type=Path, help="where the timed path, its certificate and the ledger go")
    path.add_argument("--seed", type=int, default=0, help="of the random trees, the last resort (default: 0)")


def run(given: argparse.Namespace) -> int:
    from handey_studio.motion.answer import answer_path, path_report
    from handey_studio.world import Library

    check_output(given.json)
    robot = Library.choose(given.library).robot(given.robot)
    answer = answer_path(robot, given.scene, given.request, seed=given.seed, progress=Lines())
    if given.json:
        write_json(given.json, path_report(answer))
    seconds = ", ".join(f"{stage} {took:.2f} s" for stage, took in answer.timing_s.items())
    result, trajectory = answer.result, answer.trajectory
    if trajectory is None or result.certificate is None:
        between = f"; in the way: {', '.join(result.separating)}" if result.separating else ""
        print(f"no path: {result.reason}{between} ({seconds})", file=sys.stderr)
        return NOTHING_FOUND
    length = float(np.linalg.norm(np.diff(result.q_rad, axis=0), axis=1).sum())
    clearance = f"{1e3 * result.certificate.least_clearance:.1f} mm ({' and '.join(result.certificate.bodies)})"
    needed = f", needed {result.needed}" if result.needed else ""
    print(f"path: {len(result.q_rad)} points, {length:.2f} rad, {trajectory.time_s[-1]:.2f} s of motion{needed}")
    print(f"  proved: least clearance {clearance}; {seconds}")
    return DONE
