"""MOVE object TO destination (Handey 1987 §2): from what was sensed to a full plan."""

import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from handey_studio.base import Entry, Ledger, Progress, Share, Silent, describe
from handey_studio.base.errors import unknown_name
from handey_studio.task.destination import base_name, goal_poses, parse_destination
from handey_studio.task.grasp_search import grasps_of
from handey_studio.task.legs import Start, complete
from handey_studio.task.options import Goal, Option, check_goal, list_options
from handey_studio.task.plan import MoveCommand, MoveResult
from handey_studio.world import Part, PlacedPart, World


@dataclass(frozen=True)
class MoveOptions:
    """`seed` drives every choice by chance. At most `max_groups` grasp groups are looked at: work is counted, not seconds."""

    seed: int = 0
    max_groups: int = 400


def check_command(command: MoveCommand, parts: dict[str, Part]) -> None:
    """Raises BadInput if the command names an unknown part or a destination that cannot be understood."""
    if base_name(command.part) not in parts:
        raise unknown_name("part", command.part, parts)
    parse_destination(command.to, command.part, parts)


def plan_move(
    world: World,
    command: MoveCommand,
    parts: dict[str, Part],
    start: Start,
    options: MoveOptions = MoveOptions(),
    progress: Progress = Silent(),
) -> MoveResult:
    """Plan one MOVE in the world as sensed. A MOVE that cannot be planned is a result too, with the reasons in its ledger."""
    check_command(command, parts)
    ledger, timing = Ledger(), {}
    rng = np.random.default_rng(options.seed)
    with _timed(timing, "destination"):
        goals = _goals(world, command, parts, ledger)
    plan, reason = None, _goal_reason(world, command, ledger) if not goals else ""
    if goals:
        with _timed(timing, "options"):
            tries = _within(list_options(goals, ledger), options.max_groups, ledger)
        for count, option in enumerate(tries):
            if progress.cancelled:
                reason = "cancelled"
                break
            part = Share(progress, count / len(tries), (count + 1) / len(tries))
            part.report(0.0, f"grasp group {count + 1} of {len(tries)}: {option.group.name}")
            entry = ledger.add("grasp group", option.name, parent=option.goal.entry)
            with _timed(timing, "grasp"):
                grasps = grasps_of(option, entry, ledger)
            for grasp in grasps:
                with _timed(timing, "motion"):
                    plan = plan or complete(grasp, start, ledger, part, rng)
            if plan is not None:
                break
            if grasps:
                ledger.fall(entry, "no arm motion was found for its grasps")
        else:
            reason = _why_none(ledger.entries)
    shown = goals[0] if goals else None
    return MoveResult(
        command,
        "planned" if plan else "failed",
        "" if plan else reason,
        plan,
        plan.T_world_part_start if plan else shown and shown.instance.T_world_part,
        plan.T_world_part_goal if plan else shown and shown.T_world_goal,
        ledger=ledger.entries,
        timing_s=timing,
    )


def _within(tries: list[Option], limit: int, ledger: Ledger) -> list[Option]:
    """The best `limit` options; that there are more is in the ledger."""
    if len(tries) > limit:
        ledger.add("options", f"{len(tries) - limit} more grasp groups", "not looked at: over the limit", value=len(tries), limit=limit)
    return tries[:limit]


def _goals(world: World, command: MoveCommand, parts: dict[str, Part], ledger: Ledger) -> list[Goal]:
    """The instances that the command may mean, each with every place that its destination may mean."""
    destination = parse_destination(command.to, command.part, parts)
    found = []
    for placed in _candidates(world, command.part):
        for label, T_world_goal in goal_poses(destination, placed.name, parts, world.parts):
            goal = check_goal(world, placed, label, T_world_goal, ledger)
            if goal is not None:
                found.append(goal)
    return found


def _candidates(world: World, name: str) -> list[PlacedPart]:
    return [placed for placed in world.parts if name in (placed.name, placed.part.name)]


def _goal_reason(world: World, command: MoveCommand, ledger: Ledger) -> str:
    """Why there is not even a goal, in a sentence."""
    located = ", ".join(placed.name for placed in world.parts) or "nothing"
    if not _candidates(world, command.part):
        return f'"{command.part}" was not found in the scan; found: {located}'
    fallen = [entry for entry in ledger.entries if entry.reason]
    if not fallen:
        return f'nothing to put it on: "{command.to}" needs another part than the one that moves; found: {located}'
    return describe(fallen[0])


def _why_none(entries: tuple[Entry, ...]) -> str:
    """Why no option was left: the commonest reasons, and whether a regrasp would be the way."""
    groups = [entry for entry in entries if entry.stage == "grasp group" and entry.reason]
    if not groups:
        return "the hand cannot grasp this part: " + (describe(entries[-1]) if entries else "it has no pair of parallel faces")
    counts = Counter(entry.reason for entry in groups)
    said = "; ".join(f"{count} × {reason}" for reason, count in counts.most_common(3))
    text = f"none of {len(groups)} grasp groups works: {said}"
    pickup_only = sum(count for reason, count in counts.items() if reason and "putdown" in reason)
    if pickup_only:
        text += f"; {pickup_only} are free at the pickup but not at the putdown: a regrasp might help, which is not built yet"
    return text


@contextmanager
def _timed(timing: dict[str, float], stage: str) -> Iterator[None]:
    begun = time.perf_counter()
    try:
        yield
    finally:
        timing[stage] = timing.get(stage, 0.0) + time.perf_counter() - begun
