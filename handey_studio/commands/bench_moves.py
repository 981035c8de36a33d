"""`handey bench moves`: one MOVE in each of many random scenes."""

import argparse
from pathlib import Path

from handey_studio.commands.arguments import DONE, check_output, seeds, write_json

NAME = "bench moves"
HELP = "one MOVE in each of many random scenes, judged against the hidden truth"


def add_arguments(bench: argparse.ArgumentParser) -> None:
    bench.add_argument("--seeds", type=seeds, help="FIRST:END of the seeds (default: 0:20)")
    bench.add_argument(
        "--scenes",
        choices=("clutter", "regrasp", "piles"),
        default="clutter",
        help="solvable by construction among clutter, or only by putting the part down on the way; or whatever fell (default: clutter)",
    )
    bench.add_argument("--robot", default="ur5", help="a robot of the library (default: ur5)")
    bench.add_argument("--json", type=Path, help="write the table here")


def run(given: argparse.Namespace) -> int:
    from handey_studio.task.bench.moves import bench_moves
    from handey_studio.world import Library

    check_output(given.json)
    report = bench_moves(given.seeds or range(20), Library.choose(given.library), print, given.scenes, given.robot)
    if given.json:
        write_json(given.json, report)
    return DONE
