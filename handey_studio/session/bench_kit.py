"""Benchmark: whole sequences, unattended. A pile of ten parts is sorted into a tray with a place for each."""

import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import Any

from handey_studio.base import BadInput
from handey_studio.cell.scenes.kits import kit
from handey_studio.geometry.transforms import pose_difference
from handey_studio.session.run import cell_of
from handey_studio.session.sequence import run_list, states_of
from handey_studio.session.session import Session, new_session
from handey_studio.task import MoveCommand
from handey_studio.task.bench.act import Trial
from handey_studio.task.bench.shared_out import shared_out
from handey_studio.world import Library

NEAR_M = 0.003  # a part this near to where its result says it was put is where it was put


class _Quiet:
    cancelled = False

    def report(self, fraction: float, message: str) -> None:
        pass

    def show(self, session: Session) -> None:
        pass


def kit_session(seed: int, library: Library, robot: str = "ur5", physics: bool = True) -> Session:
    """A session with a pile, a tray and the ten commands that fill it."""
    made = kit(seed, library, robot, physics)
    return new_session(f"kit {seed}", made.workcell, library, tuple(MoveCommand(*command) for command in made.commands), seed)


def bench_kit(seeds: Iterable[int], tell: Callable[[str], None], trial: Trial, jobs: int = 1) -> dict[str, Any]:
    """Run every seed's commands to their end; the table as JSON values, a line told for each."""
    rows = []
    for found in shared_out(partial(_sorted, trial), seeds, jobs):
        tell(found if isinstance(found, str) else _line(found))
        rows += [] if isinstance(found, str) else [found]
    complete = sum(row["done"] == row["commands"] for row in rows)
    truly = sum(row["truly"] == row["commands"] for row in rows)
    tell(f"{complete} of {len(rows)} sequences complete, {truly} truly so")
    summary = {"sequences": len(rows), "complete": complete, "truly": truly}
    return {"schema": "handey/bench/kit/1", "robot": trial.robot, "rows": rows, "summary": summary}


def _sorted(trial: Trial, seed: int) -> dict[str, Any] | str:
    """The row of a seed, or why there is no scene."""
    try:
        session = kit_session(seed, trial.library, trial.robot)
    except BadInput as error:
        return f"{seed:4d} no scene: {error}"
    return _row(seed, replace(session, attempts=trial.attempts), trial.library)


def _line(row: dict[str, Any]) -> str:
    times = f"{row['cell_s']:.0f} s of the cell's time, {row['wall_s']:.0f} s"
    done = f"{row['done']} of {row['commands']} done, {row['truly']} truly there, {row['postponed']} times postponed"
    return f"{row['seed']:4d} {done}, {row['incidents']} incidents, {times}; {'; '.join(row['failed'])[:300]}"


def _row(seed: int, session: Session, library: Library) -> dict[str, Any]:
    """One sequence, judged by the truth."""
    begun = time.perf_counter()
    session = run_list(session, library, _Quiet(), go_on=True)
    states = states_of(session)
    performances = [performance for result in session.results for performance in result.performances]
    return {
        "seed": seed,
        "commands": len(states),
        "done": sum(state.status == "done" for state in states),
        "truly": _truly(session, library),
        "postponed": sum(result.status != "done" for result in session.results),
        "incidents": sum(len(performance.incidents) for performance in performances),
        "failed": [session.results[state.result].reason for state in states if state.status == "failed"],
        "cell_s": sum(performance.seconds for performance in performances),
        "wall_s": time.perf_counter() - begun,
    }


def _truly(session: Session, library: Library) -> int:
    """How many of the parts of commands that are done really stand where their result says."""
    bodies, count = cell_of(session, library).true_scene(), 0
    for command, state in zip(session.commands, states_of(session), strict=True):
        T = session.results[state.result].T_world_part_reached if state.status == "done" else None
        mine = [body for body in bodies if body.name.split("#")[0] == command.part.split("#")[0]]
        part = session.part(command.part)
        if T is not None and part is not None:
            count += any(pose_difference(body.T_world_body @ S, T)[0] < NEAR_M for body in mine for S in part.symmetries)
    return count
