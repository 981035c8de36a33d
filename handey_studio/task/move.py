"""MOVE object TO destination (Handey 1987 §2): from what was sensed to a full plan."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from handey_studio.base import Ledger, Progress, Silent
from handey_studio.base.errors import unknown_name
from handey_studio.task.areas import area_poses
from handey_studio.task.carrying import Start
from handey_studio.task.destination import Area, base_name, goal_poses, parse_destination
from handey_studio.task.options import Goal, check_goal
from handey_studio.task.plan import MoveCommand, MovePlan, MoveResult
from handey_studio.task.reasons import EFFORT_SPENT, settle, why_no_goal, why_no_plan
from handey_studio.task.search import OptionSearch, SearchOptions
from handey_studio.world import Part, PlacedPart, World

SETTLED_M = 0.02  # nearer than this to where it was put it is the same part, whatever the naming of its symmetries
UNSURE = "it could nearly as well stand otherwise, or be another part"


@dataclass(frozen=True)
class MoveOptions:
    """`seed` drives every choice by chance; `search` bounds the work, which is counted, not timed. A part that could nearly as well stand
    otherwise, or be another, is not moved: `most_doubt` is the greatest share of its own probability that the likeliest rival may have.
    `settled` are parts (name, x, y, z [m]) that earlier commands put in their places: a command that does not name one does not mean it."""

    seed: int = 0
    most_doubt: float = 0.8
    settled: tuple[tuple[str, float, float, float], ...] = ()
    search: SearchOptions = field(default_factory=SearchOptions)


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
    doubts: Mapping[str, float] | None = None,
) -> MoveResult:
    """Plan one MOVE in the world as sensed. A MOVE that cannot be planned is a result too, with the reasons in its ledger.

    `doubts` tell of instances how probable their likeliest rival is, as a share of their own probability.
    """
    check_command(command, parts)
    ledger, timing = Ledger(), {}
    with _timed(timing, "destination"):
        goals = _goals(world, command, parts, ledger, doubts or {}, options)
    plan, reason = None, ""
    if not goals:
        reason = why_no_goal(world, len(_candidates(world, command.part)), command.part, command.to, ledger.entries)
    if goals:
        search = OptionSearch(start, ledger, progress, np.random.default_rng(options.seed), options.search)
        with _timed(timing, "search"):
            plan = _best(search, goals, options.search.improve)
        _close(search, plan, ledger)
        reason = "cancelled" if progress.cancelled and plan is None else why_no_plan(ledger.entries)
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


def _best(search: OptionSearch, goals: list[Goal], improve: int) -> MovePlan | None:
    """The first plan, or with `improve` the quickest of that many more."""
    best = None
    for count, plan in enumerate(search.run(goals)):
        best = plan if best is None or plan.duration < best.duration else best
        if count >= improve:
            break
    return best


def _close(search: OptionSearch, plan: MovePlan | None, ledger: Ledger) -> None:
    """What fell because everything below it did, and how much was not looked at."""
    waiting = search.waiting
    settle(ledger, {node.entry for node in waiting})
    if waiting:
        why = "not looked at: there is a plan" if plan else EFFORT_SPENT
        ledger.add("options", f"{len(waiting)} more", why, value=search.spent, limit=search.options.effort, unit="s")


def _goals(
    world: World, command: MoveCommand, parts: dict[str, Part], ledger: Ledger, doubts: Mapping[str, float], options: MoveOptions
) -> list[Goal]:
    """The instances that the command may mean, each with every place that its destination may mean."""
    destination = parse_destination(command.to, command.part, parts)
    found = []
    for placed in _candidates(world, command.part):
        if doubts.get(placed.name, 0.0) > options.most_doubt:
            ledger.add("destination", placed.name, UNSURE, value=doubts[placed.name], limit=options.most_doubt)
            continue
        if placed.name != command.part and _is_settled(placed, options):
            ledger.add("destination", placed.name, "an earlier command put it there")
            continue
        area = isinstance(destination, Area)
        poses = area_poses(world, placed, destination, ledger) if area else goal_poses(destination, placed.name, parts, world.parts)
        for label, T_world_goal in poses:
            goal = check_goal(world, placed, label, T_world_goal, ledger)
            if goal is not None:
                found.append(goal)
    return found


def _is_settled(placed: PlacedPart, options: MoveOptions) -> bool:
    """Whether an earlier command put it where it stands."""
    places = [place for name, *place in options.settled if name == placed.part.name]
    return any(np.linalg.norm(placed.T_world_part[:3, 3] - place) < SETTLED_M for place in places)


def _candidates(world: World, name: str) -> list[PlacedPart]:
    return [placed for placed in world.parts if name in (placed.name, placed.part.name)]


@contextmanager
def _timed(timing: dict[str, float], stage: str) -> Iterator[None]:
    begun = time.perf_counter()
    try:
        yield
    finally:
        timing[stage] = timing.get(stage, 0.0) + time.perf_counter() - begun
