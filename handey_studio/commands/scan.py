"""`handey scan`: photographs of laser stripes into a cloud."""

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from handey_studio.base import BadInput
from handey_studio.commands.arguments import DONE, NOTHING_FOUND, Lines, check_output, check_suffix, three, write_json

NAME = "scan"
HELP = "triangulate a folder of laser-stripe photographs into a cloud and a depth map"


def add_arguments(scan: argparse.ArgumentParser) -> None:
    scan.add_argument(
        "folder", type=Path, help="the photographs, png or jpg, in the order of their names; NAME.dark.png or dark.png: laser off"
    )
    scan.add_argument("--calibration", required=True, type=Path, help="the range finder's file (from scan calibrate, or written by hand)")
    scan.add_argument("--dark", type=Path, help="the dark frame of photographs without one of their own")
    scan.add_argument("--cloud", type=Path, metavar="OUT.ply", help="where the readings go, in metres, in the world's frame")
    scan.add_argument(
        "--depth", type=Path, metavar="OUT", help=".npy or .png: depth image for locate, its camera beside it; .npz: depth map"
    )
    scan.add_argument("--json", type=Path, help="where the counts, the noise and the timing go")
    scan.add_argument("--channel", default="auto", help="the laser's colour: auto, red, green, blue or grey (default: auto)")
    scan.add_argument("--stripe", default="auto", help="how the stripe runs through the photographs: auto, down or across (default: auto)")
    scan.add_argument(
        "--step-mm", type=three, metavar="X,Y,Z", help="the rig's step between photographs, in the range frame (default: the file's)"
    )
    scan.add_argument("--cell-mm", type=float, help="side of the depth map's cells (default: the file's, or the stripes' spacing)")


def run(given: argparse.Namespace) -> int:
    from handey_studio.cell.recorded import write_depth_map
    from handey_studio.geometry.transforms import apply, transform
    from handey_studio.sensing.stripes.instrument_file import read_instrument
    from handey_studio.sensing.stripes.scan import ScanOptions, depth_map_of, scan_folder
    from handey_studio.sensing.stripes.scan_files import scan_view, write_cloud, write_view
    from handey_studio.sensing.stripes.scan_report import scan_lines, scan_report

    for output in (given.cloud, given.depth, given.json):
        check_output(output)
    check_suffix(given.cloud, ".ply")
    check_suffix(given.depth, ".npy", ".png", ".npz")
    instrument = read_instrument(given.calibration)
    if given.cell_mm is not None:
        instrument = replace(instrument, cell=1e-3 * given.cell_mm)
    if given.step_mm is not None:
        instrument = replace(instrument, rig=None, rig_step=transform(None, 1e-3 * np.array(given.step_mm)))
    begun = time.perf_counter()
    scan = scan_folder(given.folder, instrument, given.dark, ScanOptions(given.channel, given.stripe), Lines())
    timing = {"scan": time.perf_counter() - begun}
    depth_map = depth_map_of(scan, instrument) if len(scan.points_range) else None
    timing["fuse"] = time.perf_counter() - begun - timing["scan"]
    report = scan_report(scan, instrument, depth_map, timing)
    if given.json:
        write_json(given.json, report)
    print("\n".join(scan_lines(report)))
    if depth_map is None:
        print(
            f'no stripe was read in the photographs of "{given.folder}"; try --channel or --stripe, or give a dark frame.', file=sys.stderr
        )
        return NOTHING_FOUND
    try:
        if given.cloud:
            write_cloud(given.cloud, apply(instrument.T_world_range, scan.points_range))
        if given.depth and given.depth.suffix.lower() == ".npz":
            write_depth_map(given.depth, depth_map)
        elif given.depth:
            write_view(given.depth, scan_view(scan, instrument))
    except OSError as error:
        raise BadInput(f'"{error.filename}" cannot be written: {error.strerror}.') from None
    return DONE
