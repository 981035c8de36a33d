"""`handey scan calibrate`: camera and laser plane from photographs of a board."""

import argparse
from pathlib import Path

from handey_studio.base import BadInput
from handey_studio.commands.arguments import DONE, Lines, board_size, check_output, positive

NAME = "scan calibrate"
HELP = (
    "camera and laser plane from photographs of a flat board, with the laser off and on and nothing moved in between (NAME.png and "
    "NAME.laser.png, or any names: partners show one pose), or with the laser on only; NAME.moved.png: the same board after the rig's steps"
)


def add_arguments(calibrate: argparse.ArgumentParser) -> None:
    calibrate.add_argument(
        "folder",
        type=Path,
        nargs="+",
        help="the board's photographs, in one folder or several: at least 3 poses, tilted by some 30°",
    )
    calibrate.add_argument(
        "--board", required=True, type=board_size, metavar="COLSxROWS", help="its INNER corners: 10 × 7 squares have 9x6"
    )
    calibrate.add_argument("--square-mm", required=True, type=float, help="side of a square; between circles, their distance")
    calibrate.add_argument("--out", required=True, type=Path, help="where the range finder's file goes")
    calibrate.add_argument("--pattern", default="chessboard", help="chessboard or circles (a square grid of dots; default: chessboard)")
    calibrate.add_argument("--camera", type=Path, help="a range finder's file whose camera is kept; only the laser is calibrated")
    calibrate.add_argument("--table", metavar="NAME", help="photograph whose board is z = 0 of the range frame (default: the first)")
    calibrate.add_argument("--moved-steps", type=positive, default=1, help="steps of the rig from NAME to NAME.moved (default: 1)")
    calibrate.add_argument("--step-mm", type=float, help="length of a step, where it is known better than photographs tell")
    calibrate.add_argument("--channel", default="auto", help="the laser's colour: auto, red, green, blue or grey (default: auto)")


def run(given: argparse.Namespace) -> int:
    from handey_studio.sensing.stripes.board import Board
    from handey_studio.sensing.stripes.calibrate import CalibrateOptions, calibrate
    from handey_studio.sensing.stripes.instrument_file import read_instrument, write_instrument
    from handey_studio.sensing.stripes.scan_report import calibration_lines, calibration_report

    check_output(given.out)
    board = Board(given.board[0], given.board[1], 1e-3 * given.square_mm, given.pattern)
    camera = None if given.camera is None else read_instrument(given.camera).cameras[0]
    step_m = None if given.step_mm is None else 1e-3 * given.step_mm
    options = CalibrateOptions(given.channel, given.table, given.moved_steps, step_m)
    found = calibrate(given.folder, board, camera, options, Lines())
    report = calibration_report(found)
    try:
        write_instrument(given.out, found.instrument, report)
    except OSError as error:
        raise BadInput(f'"{given.out}" cannot be written: {error.strerror}.') from None
    print("\n".join(calibration_lines(report)))
    return DONE
