"""`handey locate`: find known parts in a depth image."""

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from handey_studio.base import BadInput
from handey_studio.commands.arguments import DONE, NOTHING_FOUND, check_output, positive, write_json

if TYPE_CHECKING:
    from handey_studio.sensing.depth_view import DepthView

NAME = "locate"
HELP = "find known parts in a depth image"


def add_arguments(locate: argparse.ArgumentParser) -> None:
    locate.add_argument("--depth", required=True, type=Path, help="16-bit PNG, or a cloud: .npy, .ply, .pcd")
    locate.add_argument("--camera", type=Path, help="camera JSON with fx fy cx cy depth_scale (a cloud can do without)")
    locate.add_argument("--cloud-unit", choices=("m", "cm", "mm"), default="m", help="unit of a cloud's coordinates (default: m)")
    locate.add_argument("--part", required=True, action="append", help="a part by name, or a mesh file; may be given again")
    locate.add_argument("--part-scale", type=float, default=1.0, help="scales mesh files on reading: 0.001 for millimetres")
    locate.add_argument("--max-poses", type=positive, default=5, help="at most this many of each part (default: 5)")
    locate.add_argument("--seed", type=int, default=0)
    locate.add_argument("--json", required=True, type=Path, help="where the poses go")
    locate.add_argument("--depth-map", type=Path, metavar="MAP.npz", help="where the grid of elevations goes, for a recorded cell")


def run(given: argparse.Namespace) -> int:
    from handey_studio.localization import LocateOptions, localize
    from handey_studio.localization.report import locate_report
    from handey_studio.sensing.reading.files import read_depth
    from handey_studio.sensing.reading.report import seen_report
    from handey_studio.sensing.support import support_planes
    from handey_studio.world import Library

    for output in (given.json, given.depth_map):
        check_output(output)
    library = Library.choose(given.library)
    parts = [library.part(name, given.part_scale) for name in given.part]
    begun = time.perf_counter()
    reading, supports = read_depth(given.depth, given.camera, given.cloud_unit), None
    timing, view, options = {"read": time.perf_counter() - begun}, reading.view, LocateOptions(max_poses=given.max_poses)
    rng = np.random.default_rng(given.seed)
    if not reading.knows_world:
        begun = time.perf_counter()
        supports = support_planes(view, rng)
        view = replace(view, T_world_sensor=supports.table.T_world_sensor)
        options = options if supports.table.found else replace(options, table_z_m=None)
        timing["support"] = time.perf_counter() - begun
    if given.depth_map:
        _keep_map(given.depth_map, view)
    result = localize(view, parts, options, rng)
    report = locate_report(result, view.T_world_sensor, timing) | seen_report(reading, supports)
    for pose in report["poses"]:
        pose["T_file_part"] = (reading.T_file_sensor @ pose["T_sensor_part"]).tolist()
    write_json(given.json, report)
    if not result.poses:
        print(result.reason, file=sys.stderr)
        return NOTHING_FOUND
    for pose in result.poses:
        x, y, z = pose.T_world_part[:3, 3]
        seen = f"score {pose.score:.2f}, {pose.edges_found} of {pose.edges_predicted} edges found"
        others = "; could also be " + ", ".join(f"{r.part} ({r.probability:.2f})" for r in pose.rivals) if pose.rivals else ""
        print(f"{pose.part} at {x:.4f}, {y:.4f}, {z:.4f} m, {seen}{others}")
    return DONE


def _keep_map(path: Path, view: "DepthView") -> None:
    from handey_studio.cell.recorded import write_depth_map
    from handey_studio.sensing.view_map import depth_map_of

    try:
        write_depth_map(path, depth_map_of(view))
    except OSError as error:
        raise BadInput(f'"{path}" cannot be written: {error.strerror}.') from None
