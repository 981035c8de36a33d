"""`handey bench space`: how long configuration spaces take, and whether what they call free is free."""

import argparse
from pathlib import Path

from handey_studio.commands.arguments import DONE, FAILED, Lines, check_output, seeds, whole, write_json

NAME = "bench space"
HELP = "configuration spaces: time from a new depth map, when one part moved, of a query; free cells held against exact collision"


def add_arguments(bench: argparse.ArgumentParser) -> None:
    bench.add_argument("--robot", action="append", metavar="NAME", help="robot of the library or folder, may be repeated (default: ur5)")
    bench.add_argument("--seeds", type=seeds, default=range(8), help="FIRST:END of the random scenes (default: 0:8)")
    bench.add_argument("--cells", type=whole, default=0, help="so many random free cells of each robot are held against exact collision")
    bench.add_argument("--cold", action="store_true", help="also time a fresh process to its first path")
    bench.add_argument("--json", type=Path, help="write the numbers here")


def run(given: argparse.Namespace) -> int:
    from handey_studio.task.bench.motion.space_cells import check_cells
    from handey_studio.task.bench.motion.space_times import cold_start, measure_spaces
    from handey_studio.world import Library

    check_output(given.json)
    library, report, colliding = Library.choose(given.library), [], 0
    for name in given.robot or ["ur5"]:
        robot = library.robot(name)
        print(f"{robot.name}: {len(given.seeds)} scenes")
        found = measure_spaces(robot, given.seeds, print, Lines())
        if given.cold:
            found["cold_start_s"] = cold_start(name, given.library)
            print(f"{'a fresh process to its first path':44}{1e3 * found['cold_start_s']:9.1f} ms")
        if given.cells:
            found["cells"] = check_cells(robot, given.seeds, given.cells, print, Lines())
            colliding += found["cells"]["colliding"]
        report.append(found)
    if given.json:
        write_json(given.json, {"schema": "handey/bench/space/1", "robots": report})
    return FAILED if colliding else DONE
