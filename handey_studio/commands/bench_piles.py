"""`handey bench piles`: one MOVE in each of many random piles."""

import argparse
from pathlib import Path

from handey_studio.commands.arguments import DONE, check_output, seeds, write_json
from handey_studio.world import Library

NAME = "bench piles"
HELP = "one MOVE in each of many random piles"


def add_arguments(bench: argparse.ArgumentParser) -> None:
    bench.add_argument("--seeds", type=seeds, help="FIRST:END of the seeds (default: 0:20)")
    bench.add_argument("--json", type=Path, help="write the table here")


def run(given: argparse.Namespace) -> int:
    from handey_studio.task.bench import bench_piles

    check_output(given.json)
    report = bench_piles(given.seeds or range(20), Library.choose(given.library), tell=print)
    if given.json:
        write_json(given.json, report)
    return DONE
