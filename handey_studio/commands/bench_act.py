"""`handey bench act`: MOVEs carried out in the cell with forces."""

import argparse
from pathlib import Path

from handey_studio.base import BadInput
from handey_studio.commands.arguments import DONE, check_output, positive, seeds, write_json

NAME = "bench act"
HELP = "MOVEs carried out in the cell with forces: where the part truly came to stand, what was noticed and put right"


def add_arguments(bench: argparse.ArgumentParser) -> None:
    bench.add_argument("--seeds", type=seeds, help="FIRST:END of the seeds (default: 0:10)")
    bench.add_argument("--faults", nargs="?", const="all", metavar="KIND,…", help="with faults on purpose, every kind in every scene")
    bench.add_argument("--kit", action="store_true", help="sequences instead: a pile of ten parts sorted into a tray")
    bench.add_argument("--attempts", type=positive, default=3, help="how often a MOVE is tried (default: 3)")
    bench.add_argument("--robot", default="ur5", help="a robot of the library (default: ur5)")
    bench.add_argument("--jobs", type=positive, default=1, help="so many processes share the seeds (default: 1)")
    bench.add_argument("--json", type=Path, help="write the table here")


def run(given: argparse.Namespace) -> int:
    from handey_studio.session.bench_kit import bench_kit
    from handey_studio.task.bench.act import Trial, bench_act, bench_act_faults
    from handey_studio.world import Library

    check_output(given.json)
    trial = Trial(Library.choose(given.library), given.robot, given.attempts, kinds(given.faults))
    bench = bench_kit if given.kit else bench_act_faults if given.faults else bench_act
    report = bench(given.seeds or range(10), lambda line: print(line, flush=True), trial, given.jobs)
    if given.json:
        write_json(given.json, report)
    return DONE


def kinds(given: str | None) -> tuple[str, ...]:
    """The kinds of faults that were asked for. Raises BadInput for one that is not known."""
    from handey_studio.task.bench.faults import FAULTS

    wanted = FAULTS if given == "all" else tuple(given.split(",")) if given else ()
    unknown = sorted(set(wanted) - set(FAULTS))
    if unknown:
        raise BadInput(f'fault "{unknown[0]}" is not known; choose among: {", ".join(FAULTS)}.')
    return wanted
