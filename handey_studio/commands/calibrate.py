"""`handey calibrate`: the range finder's frame to the robot's, by showing a cube."""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from handey_studio.commands.arguments import DONE, FAILED, Lines, check_output, positive, write_json

NAME = "calibrate"
HELP = "calibrate the range finder to the robot (§6): the hand shows a cube at several poses, each is scanned"


def add_arguments(calibrate: argparse.ArgumentParser) -> None:
    calibrate.add_argument("session", help="a session file, or its name in a library")
    calibrate.add_argument("--poses", type=positive, default=10, help="that show the cube, the paper's three among them (default: 10)")
    calibrate.add_argument("--cube-mm", type=float, default=50.0, help="side of the cube in the hand (default: 50)")
    calibrate.add_argument("--seed", type=int, default=0, help="of the places where it is shown (default: 0)")
    calibrate.add_argument(
        "--misplaced",
        type=_offset,
        metavar="X,Y,Z,YAW",
        help="the simulated range finder really stands off by this [mm, °] from where the session believes it to be",
    )
    calibrate.add_argument("--json", type=Path, help="where poses, residuals, fits and the ledger go")
    calibrate.add_argument("--save", type=Path, metavar="SESSION2", help="where the calibrated session goes")
    calibrate.add_argument("--save-before", type=Path, metavar="SESSION3", help="where the session goes as it was, but misplaced")


def run(given: argparse.Namespace) -> int:
    from handey_studio.session import find_session, read_session, write_session
    from handey_studio.session.calibrating import calibrated, cell_with_cube, misplaced, really_at
    from handey_studio.session.run import station_of
    from handey_studio.task.calibrating.calibrate import CalibrateOptions, calibrate_range
    from handey_studio.task.calibrating.report import calibration_lines, calibration_report, truth_line
    from handey_studio.world import Library

    for output in (given.json, given.save, given.save_before):
        check_output(output)
    options = CalibrateOptions(given.poses, 1e-3 * given.cube_mm, given.seed)
    library = Library.choose(given.library)
    session = read_session(find_session(library, given.session))
    if given.misplaced is not None:
        session = misplaced(session, given.misplaced)
    if given.save_before:
        write_session(given.save_before, replace(session, name=given.save_before.stem))
    cell = cell_with_cube(session, library, options.side_m)
    found = calibrate_range(station_of(session, library), cell, options, Lines())
    if given.json:
        write_json(given.json, calibration_report(found))
    lines = calibration_lines(found)
    if found.fit is None:
        print("\n".join(lines), file=sys.stderr)
        return FAILED
    print("\n".join([*lines, truth_line(found.fit.T_world_range, really_at(session), found.fit.middle_range)]))
    if given.save:
        write_session(given.save, replace(calibrated(session, found.fit.T_world_range), name=given.save.stem))
    return DONE


def _offset(text: str) -> np.ndarray:
    from handey_studio.geometry.transforms import from_xyz_rpy

    try:
        x, y, z, yaw = (float(word) for word in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f'"{text}" is not X,Y,Z,YAW, four numbers in mm and degrees') from None
    if not np.isfinite([x, y, z, yaw]).all() or max(abs(x), abs(y), abs(z)) > 1000.0:
        raise argparse.ArgumentTypeError(f'"{text}" puts the range finder more than 1000 mm away')
    return from_xyz_rpy(np.array([x, y, z]) / 1e3, (0.0, 0.0, np.deg2rad(yaw)))
