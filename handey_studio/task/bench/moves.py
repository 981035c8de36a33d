"""Benchmark: one MOVE in each of many random scenes, judged against the hidden truth by the independent checker."""

import statistics
import time
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.check.checker import Violation, check_plan, names_in_plan
from handey_studio.cell.scenes.piles import Pile, random_pile
from handey_studio.cell.scenes.solvable import solvable_move
from handey_studio.cell.simulated import SimulatedCell, simulated_cell
from handey_studio.geometry.transforms import pose_difference
from handey_studio.task.acting.recover import RecoveryOptions
from handey_studio.task.move import MoveOptions
from handey_studio.task.plan import MoveCommand, MovePlan
from handey_studio.task.planning import Station
from handey_studio.task.run import run_move
from handey_studio.task.sense import Scene
from handey_studio.world import Library, PlacedPart, Robot

PARTS = ("l_block", "t_block", "wedge", "brick", "stairs", "bracket")
STAGES = ("scan", "locate", "world", "destination", "search", "execute")
Scenes = Literal["clutter", "regrasp", "piles"]


def bench_moves(
    seeds: Iterable[int], library: Library, tell: Callable[[str], None], scenes: Scenes = "clutter", robot: str = "ur5"
) -> dict[str, Any]:
    """Run one MOVE a seed and tell a line for each; the table as JSON values.

    `clutter`: solvable by construction, crowded at both ends; `regrasp`: likewise, but no grasp works at both ends; `piles`: the part under
    whatever fell on it, to a free place, solvable or not.
    """
    rows = []
    tell(f"{'seed':>4} {'part':10} {'status':8} {'plan s':>7} {'regrasps':>8} {'off mm':>7} {'off °':>6} {'check':>6}  reason")
    for seed in seeds:
        part = PARTS[seed % len(PARTS)]
        try:
            pile = (
                random_pile(seed, part, library, robot)
                if scenes == "piles"
                else solvable_move(seed, part, library, robot, scenes == "regrasp")
            )
        except BadInput as error:
            tell(f"{seed:4d} {part:10} no scene: {error}")
            continue
        rows.append(_row(seed, pile, library))
        row = rows[-1]
        off = f"{row['off_mm']:7.2f} {row['off_deg']:6.2f}" if row["off_mm"] is not None else f"{'-':>7} {'-':>6}"
        check = "-" if row["violations"] is None else "ok" if not row["violations"] else f"{len(row['violations'])} bad"
        tell(f"{seed:4d} {part:10} {row['status']:8} {row['plan_s']:7.2f} {row['regrasps']:8d} {off} {check:>6}  {row['reason'][:160]}")
    summary = summarise(rows)
    tell(_sentence(summary))
    return {"schema": "handey/bench/moves/1", "scenes": scenes, "robot": robot, "rows": rows, "summary": summary}


def _row(seed: int, pile: Pile, library: Library) -> dict[str, Any]:
    """One MOVE: planned from what is sensed, executed in the cell, then judged with the truth."""
    robot = library.robot(pile.workcell.robot)
    station = Station(pile.workcell, robot, tuple(library.part(name) for name in pile.workcell.parts))
    cell = simulated_cell(pile.workcell, library)
    before = cell.true_scene()
    begun = time.perf_counter()
    once = RecoveryOptions(attempts=1, looks=1, look_again=False)  # the first plan is what is judged
    outcome = run_move(station, cell, MoveCommand(pile.part, pile.to), MoveOptions(seed=seed), recovery=once)
    scene, result = outcome.scene, outcome.result
    total = time.perf_counter() - begun
    off = off_truth(pile, station, cell) if result.status == "done" else (None, None)
    wrong = judge(scene, result.plan, before, robot) if scene is not None and result.plan is not None else None
    return {
        "seed": seed,
        "part": pile.part,
        "status": result.status,
        "reason": result.reason,
        "regrasps": result.plan.regrasps if result.plan else 0,
        "options": sum(entry.stage == "grasp group" for entry in result.ledger),
        "located": _located_error(scene, pile, before),
        "plan_s": sum(seconds for stage, seconds in result.timing_s.items() if stage not in ("scan", "execute")),
        "total_s": total,
        "timing_s": {stage: result.timing_s.get(stage, 0.0) for stage in STAGES},
        "off_mm": off[0],
        "off_deg": off[1],
        "violations": wrong,
    }


def _violation(violation: Violation) -> str:
    bodies = f" ({' and '.join(violation.bodies)})" if violation.bodies else ""
    return f"{violation.kind}: {violation.reason}{bodies}: {violation.value:.4g} {violation.unit}, limit {violation.limit:.4g}"


def judge(scene: Scene, plan: MovePlan, bodies: tuple[SolidBody, ...], robot: Robot) -> list[str]:
    """What the independent check finds wrong with a plan against the true bodies as they stood before it."""
    located = {placed.name: _as_true(placed, bodies) for placed in scene.instances}
    try:
        report = check_plan(plan.steps, bodies, robot, names_in_plan(bodies, located))
    except BadInput as error:
        return [str(error)]  # what the plan takes for the part is none of the bodies
    return [_violation(violation) for violation in report.violations]


def _as_true(placed: PlacedPart, bodies: tuple[SolidBody, ...]) -> NDArray:
    """The instance's pose under the symmetry that brings it nearest to a true body: the poses look the same."""
    poses = [placed.T_world_part @ S for S in placed.part.symmetries]
    return min(poses, key=lambda T: min(sum(pose_difference(T, body.T_world_body)) for body in bodies if not body.fixed))


def off_truth(pile: Pile, station: Station, cell: SimulatedCell) -> tuple[float, float]:
    """How far the part truly stands from where it was commanded, in mm and degrees, up to its symmetries."""
    truth = cell.true_pose(pile.part)
    differences = [pose_difference(truth @ S, pile.T_world_goal) for S in station.models[pile.part].symmetries]
    metres, radians = min(differences, key=lambda difference: difference[1])
    return 1e3 * metres, float(np.rad2deg(radians))


def _located_error(scene: Scene | None, pile: Pile, before: tuple[SolidBody, ...]) -> float | None:
    """Distance [mm] of the nearest located instance from the truth; None when nothing was located."""
    if scene is None or not scene.instances:
        return None
    truth = next(body for body in before if body.name == pile.part).T_world_body
    errors = [pose_difference(placed.T_world_part @ S, truth)[0] for placed in scene.instances for S in placed.part.symmetries]
    return 1e3 * min(errors)


def summarise(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts and medians of a table."""
    done = [row for row in rows if row["status"] == "done"]
    return {
        "moves": len(rows),
        "done": len(done),
        "plans_that_collide": sum(bool(row["violations"]) for row in rows),
        "plan_s_median": statistics.median(row["plan_s"] for row in rows) if rows else None,
        "plan_s_p95": float(np.quantile([row["plan_s"] for row in rows], 0.95)) if rows else None,
        "plan_s_max": max((row["plan_s"] for row in rows), default=None),
        "off_mm_median": statistics.median(row["off_mm"] for row in done) if done else None,
        "off_deg_median": statistics.median(row["off_deg"] for row in done) if done else None,
        "failed": dict(Counter(row["reason"] for row in rows if row["status"] != "done")),
    }


def _sentence(summary: dict[str, Any]) -> str:
    if not summary["moves"]:
        return "no scene could be made"
    placed = f", placed {summary['off_mm_median']:.2f} mm and {summary['off_deg_median']:.2f}° off (median)" if summary["done"] else ""
    return (
        f"{summary['done']} of {summary['moves']} MOVEs done, {summary['plans_that_collide']} plans collide by the independent check; "
        f"from depth map to plan {summary['plan_s_median']:.2f} s median, {summary['plan_s_p95']:.2f} s p95, "
        f"{summary['plan_s_max']:.2f} s at most{placed}"
    )
