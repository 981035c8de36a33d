"""`handey scan simulate`: photographs of a session's scene."""

import argparse
from pathlib import Path

import numpy as np

from handey_studio.commands.arguments import DONE, Lines, check_output, positive

NAME = "scan simulate"
HELP = "photographs of a session's scene, to try scan and calibrate on"


def add_arguments(simulate: argparse.ArgumentParser) -> None:
    simulate.add_argument("session", help="a session file, or its name in a library")
    simulate.add_argument(
        "--out", required=True, type=Path, help="the folder to make, with boards/, stripes/ and the true range finder's file"
    )
    simulate.add_argument(
        "--rig", choices=("stage", "sweep"), default="stage", help="stage: one moving camera with a lens; sweep: the cell's own"
    )
    simulate.add_argument("--stripes", type=positive, default=100, help="photographs of stripes (default: 100)")
    simulate.add_argument("--boards", type=positive, default=10, help="poses of the chessboard, 9x6 corners of 20 mm (default: 10)")
    simulate.add_argument("--laser", default="red", help="red, green or grey (default: red)")
    simulate.add_argument("--seed", type=int, default=0)


def run(given: argparse.Namespace) -> int:
    from handey_studio.cell.photographs import Exposure
    from handey_studio.cell.scenes.scan_folders import FolderOptions, moved_steps, write_stage_folder, write_sweep_folder
    from handey_studio.session import find_session, read_session
    from handey_studio.session.run import cell_of
    from handey_studio.world import Library

    library = Library.choose(given.library)
    session = read_session(find_session(library, given.session))
    options = FolderOptions(given.stripes, given.boards, Exposure(colour=given.laser))
    write = write_stage_folder if given.rig == "stage" else write_sweep_folder
    check_output(given.out)
    bodies, rng = cell_of(session, library).true_scene(), np.random.default_rng(given.seed)
    made = write(given.out, session.workcell.finder, bodies, options, rng, Lines())
    true = given.out / "true-range-finder.json"
    print(f"{given.stripes} stripes for each of {len(made.cameras)} cameras in {given.out / 'stripes'}; now try")
    if given.rig == "stage":
        steps = f"--moved-steps {moved_steps(made)}"
        print(f"  handey scan calibrate {given.out / 'boards'} --board 9x6 --square-mm 20 {steps} --out finder.json")
    print(f"  handey scan {given.out / 'stripes'} --calibration {'finder.json' if given.rig == 'stage' else true} --cloud cloud.ply")
    return DONE
