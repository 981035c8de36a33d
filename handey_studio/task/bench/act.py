"""Benchmark: MOVEs carried out in the cell with forces, judged by where the part truly came to stand; with faults on purpose too."""

import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from handey_studio.base import BadInput
from handey_studio.cell.faults import Fault
from handey_studio.cell.physics.physical import PhysicalCell
from handey_studio.cell.scenes.piles import Pile
from handey_studio.cell.scenes.solvable import solvable_move
from handey_studio.cell.simulated import simulated_cell
from handey_studio.task.acting.looking import PlaceLimits
from handey_studio.task.acting.recover import RecoveryOptions
from handey_studio.task.bench.faults import Injected, faults_of
from handey_studio.task.bench.judge import past_recovery
from handey_studio.task.bench.moves import PARTS, off_truth
from handey_studio.task.bench.shared_out import shared_out
from handey_studio.task.move import MoveOptions
from handey_studio.task.plan import MoveCommand, MoveResult
from handey_studio.task.planning import Station
from handey_studio.task.run import run_move
from handey_studio.world import FINGERS, Library

Tell = Callable[[str], None]
CELL_STAGES = ("scan", "execute")  # of a result's times: the rest is understanding the scan and planning
SEEN_M, SEEN_RAD = 3e-4, float(np.deg2rad(0.3))  # how well a scan tells a place: a part at the very limit may be judged either way


@dataclass(frozen=True)
class Trial:
    """What is the same for every seed."""

    library: Library
    robot: str = "ur5"
    attempts: int = 3
    kinds: tuple[str, ...] = ()


Rows = list[dict[str, Any]]


def bench_act(seeds: Iterable[int], tell: Tell, trial: Trial, jobs: int = 1) -> dict[str, Any]:
    """One MOVE a seed in a random pile with forces; the table as JSON values, a line told for each."""
    head = f"{'seed':>4} {'part':10} {'status':8} tries {'off mm':>7} {'off °':>6} {'cell s':>7} {'wall s':>7} {'check':8}"
    tell(f"{head} incidents; reason")
    rows = _told(shared_out(partial(_plain, trial), seeds, jobs), tell)
    summary = summarise(rows)
    tell(sentence(summary))
    return {"schema": "handey/bench/act/1", "robot": trial.robot, "rows": rows, "summary": summary}


def bench_act_faults(seeds: Iterable[int], tell: Tell, trial: Trial, jobs: int = 1) -> dict[str, Any]:
    """Every kind of fault of the trial in the MOVE of every seed: whether it was noticed, put right, and never a wrong "done"."""
    rows = _told(shared_out(partial(_spoilt, trial), seeds, jobs), tell)
    summary = summarise_faults(rows)
    for kind, counts in summary.items():
        tell(
            f"{kind}: {counts['noticed']} of {counts['mattered']} that mattered noticed, {counts['recovered']} of {counts['recoverable']} "
            f'put right where that was possible, {counts["wrong_done"]} wrong "done"'
        )
    return {"schema": "handey/bench/act/1", "robot": trial.robot, "rows": rows, "summary": summary}


def _told(found: Iterable[Rows | str], tell: Tell) -> Rows:
    """All rows, a line told for each; a sentence where there was no scene."""
    rows: Rows = []
    for some in found:
        if isinstance(some, str):
            tell(some)
            continue
        for row in some:
            tell(_line(row))
        rows += some
    return rows


def _plain(trial: Trial, seed: int) -> Rows | str:
    """The row of a seed."""
    pile = _pile(trial, seed)
    return pile if isinstance(pile, str) else [_row(seed, pile, trial, ())]


def _spoilt(trial: Trial, seed: int) -> Rows | str:
    """The rows of a seed, one a kind of fault."""
    pile = _pile(trial, seed)
    return pile if isinstance(pile, str) else [_faulty(seed, pile, trial, injected) for injected in _injected(seed, pile, trial)]


def _faulty(seed: int, pile: Pile, trial: Trial, injected: Injected) -> dict[str, Any]:
    row = {"fault": injected.kind} | _row(seed, pile, trial, injected.faults)
    past = "the arm stays jammed" if not injected.recoverable else row["past"]
    return row | {"noticed": bool(row["incidents"]) or row["status"] != "done", "recoverable": not past, "past": past}


def _pile(trial: Trial, seed: int) -> Pile | str:
    """A solvable scene with forces, or why there is none."""
    part = PARTS[seed % len(PARTS)]
    try:
        pile = solvable_move(seed, part, trial.library, trial.robot)
    except BadInput as error:
        return f"{seed:4d} {part:10} no scene: {error}"
    setup = replace(pile.workcell.setup, physics=True)
    return replace(pile, workcell=replace(pile.workcell, setup=setup))


def _injected(seed: int, pile: Pile, trial: Trial) -> Iterable[Injected]:
    """The faults for a scene, made to measure on the plan that the first attempt will follow."""
    station, cell = _station(pile, trial.library), simulated_cell(pile.workcell, trial.library)
    planned = run_move(station, cell, MoveCommand(pile.part, pile.to), MoveOptions(seed=seed), False)
    if planned.result.plan is not None:
        for kind in trial.kinds:
            yield faults_of(kind, planned.result.plan, station.robot, station.models[pile.part], np.random.default_rng([seed, len(kind)]))


def _station(pile: Pile, library: Library) -> Station:
    return Station(pile.workcell, library.robot(pile.workcell.robot), tuple(library.part(name) for name in pile.workcell.parts))


def _row(seed: int, pile: Pile, trial: Trial, faults: tuple[Fault, ...]) -> dict[str, Any]:
    """One MOVE, judged by the truth."""
    station = _station(pile, trial.library)
    workcell = replace(pile.workcell, setup=replace(pile.workcell.setup, faults=faults))
    cell = PhysicalCell(workcell, trial.library)
    begun = time.perf_counter()
    recovery = RecoveryOptions(attempts=trial.attempts)
    result = run_move(station, cell, MoveCommand(pile.part, pile.to), MoveOptions(seed=seed), recovery=recovery).result
    wall_s = time.perf_counter() - begun
    off_mm, off_deg = off_truth(pile, station, cell)
    limits = PlaceLimits()
    right = off_mm <= 1e3 * (limits.off_m + SEEN_M) and off_deg <= np.rad2deg(limits.off_rad + SEEN_RAD)
    return {
        "seed": seed,
        "part": pile.part,
        "status": result.status,
        "reason": result.reason,
        "planned": bool(result.plan or result.attempts),
        "attempts": len(result.performances),
        "incidents": [incident.kind for incident in result.incidents],
        "off_mm": off_mm,
        "off_deg": off_deg,
        "right": bool(right),
        "wrong_done": bool(result.status == "done" and not right),
        "check": result.check.found if result.check else None,
        "check_off_mm": 1e3 * result.check.off_m if result.check and result.check.off_m is not None else None,
        "touched": unplanned(cell, pile.part),
        "past": past_recovery(station, cell, result.command, seed) if faults and result.status != "done" else "",
        "cell_s": sum(performance.seconds for performance in result.performances),
        "plan_s": sum(seconds for stage, seconds in result.timing_s.items() if stage not in CELL_STAGES),
        "wall_s": wall_s,
        "tracking_mm": _worst_tracking(result),
    }


def unplanned(cell: PhysicalCell, part: str) -> dict[str, float]:
    """What the robot or the held part touched and no step allows, with the greatest force [N]: fingers may touch the part, and the part
    its support, the table, and what it stood against."""
    planned = {*((finger, part) for finger in FINGERS), (part, "table")}
    return {" and ".join(pair): force for pair, force in cell.touched_truly().items() if pair not in planned}


def _worst_tracking(result: MoveResult) -> float:
    return max((performance.tracking.hand_mm for performance in result.performances), default=0.0)


def _line(row: dict[str, Any]) -> str:
    fault = f"{row['fault']:16} " if "fault" in row else ""
    past = f"; past recovery: {row['past'][:140]}" if row["past"] else ""
    touched = "".join(f"; {pair} met with {force:.1f} N" for pair, force in row["touched"].items()) if not fault else ""
    return (
        f"{fault}{row['seed']:4d} {row['part']:10} {row['status']:8} {row['attempts']:5d} {row['off_mm']:7.2f} {row['off_deg']:6.2f} "
        f"{row['cell_s']:7.1f} {row['wall_s']:7.1f} {row['check'] or '-':8} {', '.join(row['incidents']) or 'none'}; {row['reason'][:140]}"
        f"{touched}{past}"
    )


def summarise(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts of a table."""
    done = [row for row in rows if row["status"] == "done"]
    seconds = sum(row["cell_s"] for row in rows)
    return {
        "moves": len(rows),
        "planned": sum(row["planned"] for row in rows),
        "done": len(done),
        "right": sum(row["right"] for row in rows),
        "wrong_done": sum(row["wrong_done"] for row in rows),
        "touched": sum(bool(row["touched"]) for row in done),
        "touched_N": max((force for row in done for force in row["touched"].values()), default=0.0),
        "needed_recovery": sum(row["attempts"] > 1 for row in done),
        "moves_an_hour": 3600.0 * len(done) / seconds if seconds else None,
        "times_real": seconds / sum(row["wall_s"] - row["plan_s"] for row in rows) if rows else None,
        "times_real_with_planning": seconds / sum(row["wall_s"] for row in rows) if rows else None,
        "failed": dict(Counter(row["reason"] for row in rows if row["status"] != "done")),
    }


def sentence(summary: dict[str, Any]) -> str:
    """A table's counts in words."""
    if not summary["moves"]:
        return "no scene could be made"
    hour = f", {summary['moves_an_hour']:.0f} MOVEs an hour of the cell's time" if summary["moves_an_hour"] else ""
    return (
        f"{summary['done']} of {summary['moves']} MOVEs done ({summary['planned']} planned), {summary['right']} truly within 2 mm and 1°, "
        f'{summary["wrong_done"]} wrong "done", {summary["needed_recovery"]} of the done needed recovery{hour}, '
        f"acting and looking at {summary['times_real']:.2f} times real time, {summary['times_real_with_planning']:.2f} with planning; "
        f"{summary['touched']} of the done touched what was not planned, with {summary['touched_N']:.1f} N at most"
    )


def summarise_faults(rows: list[dict[str, Any]]) -> dict[str, dict[str, int]]:
    """For each kind, and for all: how many changed anything (the MOVE did not just come out right), were noticed, put right, or called
    done wrongly."""
    kinds = dict.fromkeys(row["fault"] for row in rows)
    return {kind: _counts([row for row in rows if row["fault"] == kind]) for kind in kinds} | {"all": _counts(rows)}


def _counts(rows: list[dict[str, Any]]) -> dict[str, int]:
    mattered = [row for row in rows if row["noticed"] or not row["right"]]
    recoverable = [row for row in mattered if row["recoverable"]]
    return {
        "moves": len(rows),
        "mattered": len(mattered),
        "noticed": sum(row["noticed"] for row in mattered),
        "recoverable": len(recoverable),
        "recovered": sum(row["status"] == "done" and row["right"] for row in recoverable),
        "wrong_done": sum(row["wrong_done"] for row in rows),
    }
