"""`handey bench motion`: paths for many problems, beside peers."""

import argparse
import sys
from pathlib import Path

from handey_studio.commands.arguments import DONE, Lines, check_output, positive, seeds, write_json

NAME = "bench motion"
HELP = "paths for many problems: solved, time, length, clearance, collisions of the paths"


def add_arguments(bench: argparse.ArgumentParser) -> None:
    bench.add_argument("folder", type=Path, nargs="?", metavar="DIR", help="NAME.scene.yaml beside NAME.request.yaml, a folder a family")
    bench.add_argument("--random", type=positive, metavar="N", help="also N random deep reaches with a held part into bins and piles")
    bench.add_argument("--robot", default="ur5", help="a robot of the library, or a folder with a robot.toml (default: ur5)")
    bench.add_argument("--seeds", type=seeds, default=range(1), help="FIRST:END of the planners' seeds (default: 0:1)")
    bench.add_argument("--peers", action="store_true", help="ask OMPL and roboplan the same questions, as far as they are installed")
    bench.add_argument("--peer-python", metavar="PYTHON", help="interpreter of the environment that holds the peers (default: this one)")
    bench.add_argument("--plot", type=Path, help="draw the table into a .png, .svg or .pdf")
    bench.add_argument("--json", type=Path, help="write the table here, with every path")


def run(given: argparse.Namespace) -> int:
    from handey_studio.task.bench.motion.run import run_bench
    from handey_studio.world import Library

    for output in (given.json, given.plot):
        check_output(output)
    report = run_bench(
        Library.choose(given.library).robot(given.robot),
        tell=lambda line: print(f"\r\033[K{line}" if sys.stderr.isatty() else line, flush=True),
        progress=Lines(),
        folder=given.folder,
        random=range(given.random) if given.random else None,
        seeds=given.seeds,
        peers=given.peers,
        peer_python=given.peer_python,
        plot_to=given.plot,
    )
    if given.json:
        write_json(given.json, report)
    return DONE
