"""`handey model suggest`: closed polyhedra for what stands in a depth image."""

import argparse
import math
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from handey_studio.base import BadInput
from handey_studio.commands.arguments import DONE, NOTHING_FOUND, check_output, check_suffix, write_json

if TYPE_CHECKING:
    from handey_studio.geometry import Polyhedron

NAME = "model suggest"
HELP = "propose closed polyhedra for what stands in a depth image"


def add_arguments(suggest: argparse.ArgumentParser) -> None:
    suggest.add_argument("--depth", required=True, type=Path, help="16-bit PNG, or a cloud: .npy, .ply, .pcd")
    suggest.add_argument("--camera", type=Path, help="camera JSON with fx fy cx cy depth_scale (a cloud can do without)")
    suggest.add_argument("--cloud-unit", choices=("m", "cm", "mm"), default="m", help="unit of a cloud's coordinates (default: m)")
    suggest.add_argument("--at", type=_pixel, metavar="U,V", help="the object at this pixel (default: the largest that can be closed)")
    suggest.add_argument("--all", action="store_true", help="every object")
    suggest.add_argument("--out", type=Path, metavar="PART.obj", help="where the first object's part goes")
    suggest.add_argument("--json", required=True, type=Path, help="where the suggestions go")


def run(given: argparse.Namespace) -> int:
    from handey_studio.modeling.scans import scan_of_reading
    from handey_studio.modeling.suggesting.report import suggested
    from handey_studio.sensing.reading.files import read_depth
    from handey_studio.sensing.reading.report import seen_report

    for output in (given.json, given.out):
        check_output(output)
    check_suffix(given.out, ".obj")
    begun = time.perf_counter()
    reading = read_depth(given.depth, given.camera, given.cloud_unit)
    scan = scan_of_reading(given.depth.stem, reading, str(given.depth))
    timing = {"read": time.perf_counter() - begun}
    report, solids, reason = suggested(scan, given.at, given.all, reading.reduced_by, timing)
    write_json(given.json, report | seen_report(reading, None))
    if not solids:
        print(f"nothing suggested: {reason}.", file=sys.stderr)
        return NOTHING_FOUND
    if given.out is not None:
        _write(given.out, solids[0])
    for found in report["objects"]:
        sides = " × ".join(f"{side:.1f}" for side in found["dimensions_mm"])
        print(f"{sides} mm, {found['height_mm']:.1f} mm high, {len(found['faces'])} faces, {100 * found['explained']:.0f} % explained")
    return DONE


def _write(path: Path, solid: "Polyhedron") -> None:
    from handey_studio.world.model_files import write_obj

    try:
        write_obj(path, solid)
    except OSError as error:
        raise BadInput(f'"{path}" cannot be written: {error.strerror}.') from None


def _pixel(text: str) -> tuple[float, float]:
    try:
        u, v = (float(word) for word in text.split(","))
        if not (math.isfinite(u) and math.isfinite(v)):
            raise ValueError
    except ValueError:
        raise argparse.ArgumentTypeError(f'"{text}" is not U,V, a pixel as two numbers') from None
    return u, v
