"""`handey bench locate`: every part in many scenes."""

import argparse
import sys
from pathlib import Path

from handey_studio.commands.arguments import DONE, Lines, check_output, positive, seeds, write_json

NAME = "bench locate"
HELP = "every part in many scenes: recall, precision, errors, time"


def add_arguments(bench: argparse.ArgumentParser) -> None:
    bench.add_argument("--seeds", type=seeds, help="FIRST:END of the seeds (default: 0:20)")
    bench.add_argument("--json", type=Path, help="write the table here")
    bench.add_argument(
        "--scenes", type=Path, help="folder of scenes, simulated or labelled real ones; with --seeds, where simulated ones are kept"
    )
    bench.add_argument("--sensor", choices=("camera", "range_finder"), default="camera", help="what sees new scenes (default: camera)")
    bench.add_argument(
        "--ask",
        choices=("together", "each"),
        default="together",
        help="one call for all parts of a scene, or one for each (default: together)",
    )
    bench.add_argument("--peers", action="store_true", help="ask Open3D and OpenCV the same questions, as far as they are installed")
    bench.add_argument("--peer-python", metavar="PYTHON", help="interpreter of the environment that holds the peers (default: this one)")
    bench.add_argument("--peer-poses", type=positive, default=1, help="poses that each peer may report for a part (default: 1, its best)")
    bench.add_argument("--plot", type=Path, help="draw recall, precision and time into a .png, .svg or .pdf")


def run(given: argparse.Namespace) -> int:
    from handey_studio.task.bench.locate import run_bench
    from handey_studio.world import Library

    for output in (given.json, given.plot):
        check_output(output)
    report = run_bench(
        Library.choose(given.library),
        tell=lambda line: print(f"\r\033[K{line}" if sys.stderr.isatty() else line, flush=True),
        progress=Lines(),
        seeds=given.seeds,
        scenes=given.scenes,
        sensor=given.sensor,
        ask=given.ask,
        peers=given.peers,
        peer_python=given.peer_python,
        peer_poses=given.peer_poses,
        plot_to=given.plot,
    )
    if given.json:
        write_json(given.json, report)
    return DONE
