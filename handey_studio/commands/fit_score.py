"""`handey fit score`: the weights of the localizer's score, from simulated scenes."""

import argparse
import sys
from pathlib import Path

from handey_studio.base import BadInput
from handey_studio.base.files import replace_file
from handey_studio.commands.arguments import DONE, Lines, check_output, check_suffix, seeds, write_json

NAME = "fit score"
HELP = "fit the weights of the localizer's score to the candidates in simulated scenes, and tell how well they hold on others"


def add_arguments(fit: argparse.ArgumentParser) -> None:
    fit.add_argument("--out", required=True, type=Path, metavar="SCORE.toml", help="where the weights go")
    fit.add_argument("--seeds", type=seeds, default=range(100, 200), help="FIRST:END of the scenes' seeds (default: 100:200)")
    fit.add_argument("--scenes", type=Path, help="folder where the scenes are kept (default: they are made and forgotten)")
    fit.add_argument("--sensor", choices=("camera", "range_finder"), default="camera", help="what sees new scenes (default: camera)")
    fit.add_argument("--json", type=Path, help="write the table here")


def run(given: argparse.Namespace) -> int:
    from handey_studio.task.bench.locate.fit_score import run_fit, toml
    from handey_studio.world import Library

    for output in (given.out, given.json):
        check_output(output)
    check_suffix(given.out, ".toml")
    weights, report = run_fit(
        Library.choose(given.library),
        tell=lambda line: print(f"\r\033[K{line}" if sys.stderr.isatty() else line, flush=True),
        progress=Lines(),
        seeds=given.seeds,
        scenes=given.scenes,
        sensor=given.sensor,
    )
    try:
        replace_file(given.out, toml(weights).encode())
    except OSError as error:
        raise BadInput(f'"{given.out}" cannot be written: {error.strerror}.') from None
    if given.json:
        write_json(given.json, report)
    return DONE
