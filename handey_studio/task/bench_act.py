"""Benchmark: MOVEs carried out in the cell with forces, judged by where the part truly came to stand; with faults on purpose too."""

import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from handey_studio.base import BadInput
from handey_studio.cell.faults import Fault
from handey_studio.cell.piles import Pile
from handey_studio.cell.simulated import simulated_cell
from handey_studio.cell.solvable import solvable_move
from handey_studio.task.bench_faults import FAULTS, Injected, faults_of
from handey_studio.task.bench_moves import PARTS, off_truth
from handey_studio.task.looking import PlaceLimits
from handey_studio.task.move import MoveOptions
from handey_studio.task.plan import MoveCommand, MoveResult
from handey_studio.task.planning import Station
from handey_studio.task.recover import RecoveryOptions
from handey_studio.task.run import run_move
from handey_studio.world import Library

Tell = Callable[[str], None]
SEEN_M, SEEN_RAD = 3e-4, float(np.deg2rad(0.3))  # how well a scan tells a place: a part at the very limit may be judged either way


def bench_act(seeds: Iterable[int], library: Library, tell: Tell, robot: str = "ur5", attempts: int = 3) -> dict[str, Any]:
    """One MOVE a seed in a random pile with forces; the table as JSON values, a line told for each."""
    rows = []
    head = f"{'seed':>4} {'part':10} {'status':8} tries {'off mm':>7} {'off °':>6} {'cell s':>7} {'wall s':>7} {'check':8}"
    tell(f"{head} incidents; reason")
    for seed, pile in _piles(seeds, library, robot, tell):
        rows.append(_row(seed, pile, library, (), attempts))
        tell(_line(rows[-1]))
    summary = summarise(rows)
    tell(sentence(summary))
    return {"schema": "handey/bench/act/1", "robot": robot, "rows": rows, "summary": summary}


def bench_act_faults(
    seeds: Iterable[int], library: Library, tell: Tell, kinds: Iterable[str] = FAULTS, robot: str = "ur5", attempts: int = 3
) -> dict[str, Any]:
    """Every kind of fault in the MOVE of every seed: whether it was noticed, put right, and never a wrong "done"."""
    rows = []
    for seed, pile in _piles(seeds, library, robot, tell):
        for injected in _injected(seed, pile, library, kinds):
            row = _row(seed, pile, library, injected.faults, attempts) | {"fault": injected.kind, "recoverable": injected.recoverable}
            row["noticed"] = bool(row["incidents"]) or row["status"] != "done"
            rows.append(row)
            tell(f"{injected.kind:16} {_line(row)}")
    summary = summarise_faults(rows)
    for kind, counts in summary.items():
        tell(
            f"{kind}: {counts['noticed']} of {counts['mattered']} that mattered noticed, {counts['recovered']} of {counts['recoverable']} "
            f'put right, {counts["wrong_done"]} wrong "done"'
        )
    return {"schema": "handey/bench/act/1", "robot": robot, "rows": rows, "summary": summary}


def _piles(seeds: Iterable[int], library: Library, robot: str, tell: Tell) -> Iterable[tuple[int, Pile]]:
    """Solvable scenes with forces."""
    for seed in seeds:
        part = PARTS[seed % len(PARTS)]
        try:
            pile = solvable_move(seed, part, library, robot)
        except BadInput as error:
            tell(f"{seed:4d} {part:10} no scene: {error}")
            continue
        setup = replace(pile.workcell.setup, physics=True)
        yield seed, replace(pile, workcell=replace(pile.workcell, setup=setup))


def _injected(seed: int, pile: Pile, library: Library, kinds: Iterable[str]) -> Iterable[Injected]:
    """The faults for a scene, made to measure on the plan that the first attempt will follow."""
    station = _station(pile, library)
    planned = run_move(station, simulated_cell(pile.workcell, library), MoveCommand(pile.part, pile.to), MoveOptions(seed=seed), False)
    if planned.result.plan is not None:
        for kind in kinds:
            yield faults_of(kind, planned.result.plan, station.robot, station.models[pile.part], np.random.default_rng([seed, len(kind)]))


def _station(pile: Pile, library: Library) -> Station:
    return Station(pile.workcell, library.robot(pile.workcell.robot), tuple(library.part(name) for name in pile.workcell.parts))


def _row(seed: int, pile: Pile, library: Library, faults: tuple[Fault, ...], attempts: int) -> dict[str, Any]:
    """One MOVE, judged by the truth."""
    station = _station(pile, library)
    workcell = replace(pile.workcell, setup=replace(pile.workcell.setup, faults=faults))
    cell = simulated_cell(workcell, library)
    begun = time.perf_counter()
    recovery = RecoveryOptions(attempts=attempts)
    result = run_move(station, cell, MoveCommand(pile.part, pile.to), MoveOptions(seed=seed), recovery=recovery).result
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
        "cell_s": sum(performance.seconds for performance in result.performances),
        "wall_s": time.perf_counter() - begun,
        "tracking_mm": _worst_tracking(result),
    }


def _worst_tracking(result: MoveResult) -> float:
    return max((performance.tracking.hand_mm for performance in result.performances), default=0.0)


def _line(row: dict[str, Any]) -> str:
    return (
        f"{row['seed']:4d} {row['part']:10} {row['status']:8} {row['attempts']:5d} {row['off_mm']:7.2f} {row['off_deg']:6.2f} "
        f"{row['cell_s']:7.1f} {row['wall_s']:7.1f} {row['check'] or '-':8} {', '.join(row['incidents']) or 'none'}; {row['reason'][:140]}"
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
        "needed_recovery": sum(row["attempts"] > 1 for row in done),
        "moves_an_hour": 3600.0 * len(done) / seconds if seconds else None,
        "times_real": seconds / sum(row["wall_s"] for row in rows) if rows else None,
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
        f"all of it at {summary['times_real']:.2f} times real time"
    )


def summarise_faults(rows: list[dict[str, Any]]) -> dict[str, dict[str, int]]:
    """For each kind: how many changed anything (the MOVE did not just come out right), were noticed, put right, or called done wrongly."""
    summary = {}
    for kind in dict.fromkeys(row["fault"] for row in rows):
        mine = [row for row in rows if row["fault"] == kind]
        mattered = [row for row in mine if row["noticed"] or not row["right"]]
        recoverable = [row for row in mattered if row["recoverable"]]
        summary[kind] = {
            "moves": len(mine),
            "mattered": len(mattered),
            "noticed": sum(row["noticed"] for row in mattered),
            "recoverable": len(recoverable),
            "recovered": sum(row["status"] == "done" and row["right"] for row in recoverable),
            "wrong_done": sum(row["wrong_done"] for row in mine),
        }
    return summary
