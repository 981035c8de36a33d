"""`handey bench act`: MOVEs carried out in the cell with forces."""

import argparse
from pathlib import Path

from handey_studio.base import BadInput
from handey_studio.commands.arguments import DONE, check_output, positive, seeds, write_json
from handey_studio.world import Library

NAME = "bench act"
HELP = "MOVEs carried out in the cell with forces: where the part truly came to stand, what was noticed and put right"


def add_arguments(bench: argparse.ArgumentParser) -> None:
    bench.add_argument("--seeds", type=seeds, help="FIRST:END of the seeds (default: 0:10)")
    bench.add_argument("--faults", nargs="?", const="all", metavar="KIND,…", help="with faults on purpose, every kind in every scene")
    bench.add_argument("--kit", action="store_true", help="sequences instead: a pile of ten parts sorted into a tray")
    bench.add_argument("--attempts", type=positive, default=3, help="how often a MOVE is tried (default: 3)")
    bench.add_argument("--robot", default="ur5", help="a robot of the library (default: ur5)")
    bench.add_argument("--json", type=Path, help="write the table here")


def run(given: argparse.Namespace) -> int:
    from handey_studio.task.bench_act import bench_act, bench_act_faults
    from handey_studio.task.bench_faults import FAULTS

    check_output(given.json)
    library, wanted = Library.choose(given.library), given.seeds or range(10)
    if given.kit:
        from handey_studio.session.bench_kit import bench_kit

        report = bench_kit(wanted, library, print, given.robot, given.attempts)
    elif given.faults:
        kinds = FAULTS if given.faults == "all" else tuple(given.faults.split(","))
        unknown = sorted(set(kinds) - set(FAULTS))
        if unknown:
            raise BadInput(f'fault "{unknown[0]}" is not known; choose among: {", ".join(FAULTS)}.')
        report = bench_act_faults(wanted, library, print, kinds, given.robot, given.attempts)
    else:
        report = bench_act(wanted, library, print, given.robot, given.attempts)
    if given.json:
        write_json(given.json, report)
    return DONE
