"""Every method's path for every problem, judged; the table as JSON values."""

import os
import platform
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from handey_studio.base import BadInput, Progress
from handey_studio.task.bench.locate.plot import check_plot
from handey_studio.task.bench.motion.answers import Handey, Method, ends_free, judged
from handey_studio.task.bench.motion.peers import MotionPeers, Peer
from handey_studio.task.bench.motion.plot import plot
from handey_studio.task.bench.motion.problems import Problem, problem_files, read_problems
from handey_studio.task.bench.motion.random_reaches import random_reaches
from handey_studio.task.bench.motion.summary import Row, summarise, table
from handey_studio.world import Robot


def run_bench(
    robot: Robot,
    tell: Callable[[str], None],
    progress: Progress,
    *,
    folder: Path | None = None,
    random: range | None = None,
    seeds: range = range(1),
    peers: bool = False,
    peer_python: str | None = None,
    plot_to: Path | None = None,
) -> dict[str, Any]:
    """Measure and tell: the problems in a folder, the random reaches of some seeds, or both, each once for every seed of the planners.

    Raises BadInput, before any work where it can.
    """
    check_plot(plot_to)
    files = problem_files(folder) if folder is not None else []
    if not files and not random:
        raise BadInput("nothing to measure: name a folder of problems, or give --random N.")
    with ExitStack() as open_things:
        methods: list[Method] = [Handey(robot)]
        if peers or peer_python is not None:
            process = open_things.enter_context(MotionPeers(peer_python, seeds.start))
            methods += [Peer(process, name) for name in process.names]
        problems = _problems(robot, files, folder, random or range(0))
        report = bench_motion(problems, methods, seeds, tell, progress, len(files) + len(random or ()))
    if plot_to is not None and report["rows"]:
        plot(report["rows"], plot_to)
    return report | {"robot": robot.name}


def _problems(robot: Robot, files: list[Path], folder: Path | None, random: range) -> Iterator[Problem]:
    if folder is not None:
        yield from read_problems(files, folder, robot)
    yield from random_reaches(robot, random)


def bench_motion(
    problems: Iterable[Problem], methods: Sequence[Method], seeds: range, tell: Callable[[str], None], progress: Progress, count: int
) -> dict[str, Any]:
    """Ask every method for every problem, tell a line a problem and the table at the end. Cancelled, it sums up what was asked so far."""
    rows: list[Row] = []
    for number, problem in enumerate(problems):
        if progress.cancelled:
            break
        progress.report(number / max(count, 1), f"{problem.family} {problem.name}")
        free = ends_free(problem)
        asked = [_row(problem, method, seed) | {"ends_free": free} for seed in seeds for method in methods]
        tell(_line(problem, asked))
        rows += asked
    summary = summarise(rows)
    for line in table(summary):
        tell(line)
    machine = {"cpus": os.cpu_count(), "python": platform.python_version()}
    return {"schema": "handey/bench/motion/1", "machine": machine, "summary": summary, "rows": rows}


def _row(problem: Problem, method: Method, seed: int) -> Row:
    row = {"family": problem.family, "name": problem.name, "seed": seed, "method": method.name}
    return row | judged(problem, method.plan(problem, seed))


def _line(problem: Problem, rows: Sequence[Row]) -> str:
    """A problem in a line: of each method the seconds and the length, or why there is none."""
    words = []
    for row in rows:
        said = f"{row['length_rad']:.2f} rad" if row["found"] else f"none, {row['reason']}"
        hits = [" and ".join(hit["bodies"]) for hit in row.get("collisions", ())]
        words.append(f"{row['method']} {row['seconds']:.2f} s {said}{f', COLLIDES: {hits[0]}' if hits else ''}")
    return f"{problem.family} {problem.name}: {'; '.join(words)}"
