"""A planned MOVE carried out (Handey 1987 §2), with what Handey lacked: it notices what went wrong, and tries anew.

After an incident things are put right as far as rules allow; then a new scan, and a new plan with the failed option ruled out, within a
budget of attempts. A MOVE is done only when a new scan shows the part at its place, or when nobody can see there and nothing that was
felt speaks against it; then the result says so.
"""

import time
from dataclasses import dataclass, field, replace

import numpy as np

from handey_studio.base import Ledger, Progress, Share, Silent, Value
from handey_studio.cell.protocol import CannotAct, Cell
from handey_studio.geometry.transforms import pose_difference
from handey_studio.task.acting.attempt import Tried, attempt
from handey_studio.task.acting.performance import Incident, Recovery
from handey_studio.task.acting.recover import Lesson, RecoveryOptions, lesson_of
from handey_studio.task.destination import base_name, parse_destination
from handey_studio.task.move import MoveOptions
from handey_studio.task.plan import Attempt, MoveCommand, MovePlan, MoveResult
from handey_studio.task.planning import Station, plan_in, sense, understood
from handey_studio.task.ruled_out import RuledOut
from handey_studio.task.sense import Scene
from handey_studio.world import Block

SAME_M = 0.01  # an instance that is seen again this near to where another was is that one
ACTING = 0.7  # how much of an attempt's progress is behind when it has acted and plans anew


@dataclass(frozen=True, eq=False)
class Order(Value):
    """What is to be done: the command at a station, with the options of planning and of recovery."""

    station: Station
    command: MoveCommand
    options: MoveOptions = field(default_factory=MoveOptions)
    recovery: RecoveryOptions = field(default_factory=RecoveryOptions)


@dataclass(frozen=True, eq=False)
class Outcome(Value):
    """What became of a MOVE: its result, the scene in which the result's plan was made, None if the cell would not scan, and the scene
    after it, None if nobody looked."""

    result: MoveResult
    scene: Scene | None
    after: Scene | None = None


def carry_out(order: Order, scene: Scene, planned: MoveResult, cell: Cell, progress: Progress = Silent()) -> Outcome:
    """Carry out a MOVE that was planned in a scene, and again after incidents, until it is done or cannot be."""
    attempts: list[Attempt] = []
    now, ledger, most = planned, Ledger(), order.recovery.attempts
    ledger.adopt(planned.ledger)
    while (plan := now.plan) is not None:
        begun, number = time.perf_counter(), len(attempts) + 1
        share = Share(progress, (number - 1) / most, number / most)
        tried = _tried(order, scene, plan, cell, _felt(attempts), Share(share, 0.0, ACTING))
        tried, entry = _noted(tried, plan, number, ledger)
        now = _with_time(now, "execute", time.perf_counter() - begun)
        if tried.incident is None:
            return Outcome(_ended(now, tried, "done", _said(tried), attempts, ledger, cell), scene, tried.after)
        lesson = _lesson(order, tried, plan, attempts, progress)
        ledger.add("recovery", "; ".join((*tried.back.actions, lesson.why)), parent=entry)
        if lesson.hopeless:
            return Outcome(_ended(now, tried, "failed", _why(attempts, tried, lesson), attempts, ledger, cell), scene, tried.after)
        attempts.append(_kept(scene, plan, tried, lesson, len(attempts)))
        begun = time.perf_counter()
        scene, again = _anew(order, scene, attempts, tried, cell, Share(share, ACTING, 1.0))
        ledger.adopt(again.ledger, parent=ledger.add("planned anew", f"after attempt {number}", again.reason or None))
        now = _with_time(replace(again, timing_s=now.timing_s), "plan anew", time.perf_counter() - begun)
    return Outcome(_ended(now, None, "failed", _never(attempts, now), attempts, ledger, cell), scene)


def _tried(order: Order, scene: Scene, plan: MovePlan, cell: Cell, felt: tuple[Block, ...], progress: Progress) -> Tried:
    try:
        return attempt(order.station, scene, plan, cell, order.recovery, felt, order.options.seed, progress)
    except CannotAct as error:
        return Tried(incident=Incident("refused", -1, str(error)), q=cell.joints())


def _lesson(order: Order, tried: Tried, plan: MovePlan, attempts: list[Attempt], progress: Progress) -> Lesson:
    """The rule for what happened, within the budget."""
    incident, stopped = tried.incident, tried.back.stopped
    if incident is None or progress.cancelled:
        return Lesson("cancelled", hopeless=True)
    if stopped is not None:
        return Lesson(f"the way back ended: {stopped}", hopeless=True)
    lesson = lesson_of(incident, plan, tried.q, parse_destination(order.command.to, order.command.part, order.station.models))
    if len(attempts) + 1 >= order.recovery.attempts and not lesson.hopeless:
        return replace(lesson, why=f"the budget of {order.recovery.attempts} attempts is spent", hopeless=True)
    return lesson


def _anew(order: Order, scene: Scene, attempts: list[Attempt], tried: Tried, cell: Cell, progress: Progress) -> tuple[Scene, MoveResult]:
    """A new scene and a plan in it. Where there is none another scan is taken: readings come and go with the sensor's noise."""
    seen, planned = scene, MoveResult(order.command, "failed", "")
    for look in range(order.recovery.looks):
        seed = order.options.seed + len(attempts) + look
        try:
            seen = _seen(order.station, scene, tried if look == 0 else Tried(), cell, seed, progress)
        except CannotAct as error:
            return seen, replace(planned, reason=str(error))
        planned = _planned(order, seen, _same(scene, seen, attempts[-1]), attempts, cell, seed, progress)
        if planned.plan is not None or progress.cancelled:
            break
    return seen, planned


def _seen(station: Station, before: Scene, tried: Tried, cell: Cell, seed: int, progress: Progress) -> Scene:
    """What the last scan of an attempt shows, or a new one: nobody knows where things are but by the scene before."""
    if tried.after is not None:
        return tried.after
    known = before.instances
    return understood(station, tried.seen, seed, progress, known) if tried.seen is not None else sense(station, cell, seed, progress, known)


def _planned(order: Order, seen: Scene, part: str | None, attempts: list[Attempt], cell: Cell, seed: int, progress: Progress) -> MoveResult:
    """A plan that avoids what failed and was felt; if that leaves nothing, one that does not, for the scan is new."""
    q, opening, command = cell.joints(), cell.opening(), replace(order.command, part=part or order.command.part)
    ruled_out, felt, options = _ruled_out(attempts), _felt(attempts), replace(order.options, seed=seed)
    avoiding = replace(options, search=replace(options.search, ruled_out=ruled_out))
    planned = plan_in(order.station, seen, command, q, opening, avoiding, progress, felt)
    if planned.plan is None and (ruled_out or felt) and not progress.cancelled:
        planned = plan_in(order.station, seen, command, q, opening, options, progress)
    return replace(planned, command=order.command)


def _same(before: Scene, now: Scene, last: Attempt) -> str | None:
    """The instance that was moved, as it is called in the new scene: not one of the others, the nearest to where it should be now."""
    name = last.plan.part
    check = last.performance.check
    expected = last.plan.T_world_part_start if check is None else check.T_world_part
    expected = last.plan.T_world_part_goal if expected is None else expected
    others = [placed for placed in before.instances if placed.name != name]
    own = [placed for placed in now.instances if base_name(placed.name) == base_name(name)]
    free = [
        placed
        for placed in own
        if all(pose_difference(placed.T_world_part, other.T_world_part)[0] > SAME_M for other in others if other.part == placed.part)
    ]
    nearest = min(free or own, key=lambda placed: float(np.linalg.norm((placed.T_world_part - expected)[:3, 3])), default=None)
    return nearest.name if nearest is not None else None


def _kept(scene: Scene, plan: MovePlan, tried: Tried, lesson: Lesson, count: int) -> Attempt:
    incident = tried.incident or Incident("stopped", -1, "")
    felt = replace(tried.felt, name=f"felt {count + 1}") if tried.felt is not None else None
    recovery = Recovery(incident, lesson.why, tried.back.actions, lesson.ruled_out, felt)
    return Attempt(plan, tried.performance, recovery, scene.depth_map, scene.instances)


def _felt(attempts: list[Attempt]) -> tuple[Block, ...]:
    return tuple(one.recovery.felt for one in attempts if one.recovery.felt is not None)


def _ruled_out(attempts: list[Attempt]) -> tuple[RuledOut, ...]:
    return tuple(one.recovery.ruled_out for one in attempts if one.recovery.ruled_out is not None)


def _noted(tried: Tried, plan: MovePlan, number: int, ledger: Ledger) -> tuple[Tried, int]:
    """The attempt written into the ledger, its steps below it: its incidents know their entries then, and the id of its own."""
    entry = ledger.add("attempt", f"{number}: {plan.part}")
    done = {one.step for one in tried.performance.performed}
    steps = {k: ledger.add("step", plan.steps[k].kind, parent=entry) for k in sorted(done) if k >= 0}
    told = []
    for incident in tried.performance.incidents:
        at = steps.get(incident.step) if not incident.overcome else None
        below = ledger.add("incident", incident.kind, parent=entry) if at is None else at
        ledger.fall(below, incident.sentence, value=incident.value, limit=incident.limit, unit=incident.unit)
        told.append(replace(incident, entry=below))
    if tried.performance.check is not None:
        ledger.add("check", tried.performance.check.sentence, parent=entry)
    performance = replace(tried.performance, incidents=tuple(told))
    ended = next((one for one in told if tried.incident is not None and replace(one, entry=-1) == tried.incident), tried.incident)
    return replace(tried, performance=performance, incident=ended), entry


def _ended(
    now: MoveResult, tried: Tried | None, status: str, reason: str, attempts: list[Attempt], ledger: Ledger, cell: Cell
) -> MoveResult:
    performance = tried.performance if tried is not None else None
    check = performance.check if performance is not None else None
    reached = check.T_world_part if check is not None else None
    if reached is None and performance is not None:
        reached = performance.T_world_part_released
    return replace(
        now, status="done" if status == "done" else "failed", reason=reason, T_world_part_reached=reached, ledger=ledger.entries,
        physics=cell.physics, performance=performance, attempts=tuple(attempts),
    )  # fmt: skip


def _said(tried: Tried) -> str:
    """What a MOVE that is done has to add: that nobody saw the part at its place."""
    check = tried.performance.check
    return check.sentence if check is not None and check.found != "seen" else ""


def _why(attempts: list[Attempt], tried: Tried, lesson: Lesson) -> str:
    """Why it ended, in a sentence."""
    if tried.incident is None or tried.incident.kind == "stopped":
        return lesson.why if tried.incident is None else tried.incident.sentence
    return f"{tried.incident}; {lesson.why}" if not attempts else f"attempt {len(attempts) + 1}: {tried.incident}; {lesson.why}"


def _never(attempts: list[Attempt], now: MoveResult) -> str:
    """Why there was no other plan."""
    return f"{attempts[-1].recovery.incident}; after that {now.reason}" if attempts else now.reason


def _with_time(result: MoveResult, stage: str, seconds: float) -> MoveResult:
    return replace(result, timing_s=result.timing_s | {stage: result.timing_s.get(stage, 0.0) + seconds})
