"""Collision-free, certified paths between two configurations (Handey 1987 §4)."""

from collections import Counter
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Progress, Silent
from handey_studio.motion.apart import surely_apart
from handey_studio.motion.certificate import Mover, certify_with
from handey_studio.motion.layers import Layers, layers_of, turned_at_one_place
from handey_studio.motion.query import PathOptions, Query, query
from handey_studio.motion.random_trees import grow_trees
from handey_studio.motion.results import CSpaceSummary, Leg, PathResult
from handey_studio.motion.rounding import round_corners
from handey_studio.motion.shortcut import Route, shorten
from handey_studio.motion.three_legs import three_legs
from handey_studio.motion.wrist_ways import holds_far, wrist_parts, wrist_ways
from handey_studio.world import Held, World
from handey_studio.world.collision import Pairs
from handey_studio.world.collision_bodies import DEPTH_MAP, OUTSIDE, TABLE

STAGE = "path"
FEW_GROWTHS = 500  # of the random trees, before it is asked whether there can be a path at all, and for finer cells


class Attempt(NamedTuple):
    """What one way of planning gave: what beyond the paper it `needed`, points (n, joints), their movers, the space; why it fell."""

    needed: str
    points: NDArray
    movers: list[Mover]
    space: CSpaceSummary | None
    reason: str
    proven: bool = False
    bodies: tuple[str, ...] = ()


def plan_path(
    world: World,
    start: NDArray,
    goal: NDArray,
    opening: float,
    held: Held | None = None,
    allowed_start: Pairs = (),
    allowed_goal: Pairs = (),
    options: PathOptions | None = None,
    rng: np.random.Generator | None = None,
    progress: Progress | None = None,
) -> PathResult:
    """A certified path from `start` to `goal` (joints,) [rad], with the fingers `opening` [m] apart around `held`.

    Straight, if that is free. Else the paper's three legs in the slice configuration space, and more legs at an end that no straight one
    leaves; the wrist turned at one place, by other ways too; a tighter wrist box for each part of its way; finer cells; and at last random
    trees over all joints. `needed` of the result tells.

    Pairs in `allowed_start` may touch on the leg that leaves the start, those in `allowed_goal` on the leg that arrives at the goal. No
    path found comes back as status "none" with every attempt in `entries`. Without `rng` short cuts and trees are drawn from seed 0.
    """
    options, progress, rng = options or PathOptions(), progress or Silent(), rng or np.random.default_rng(0)
    asked, reason, worst = query(world, start, goal, opening, held, allowed_start, allowed_goal, options)
    ledger = Ledger()
    if reason:
        value, bodies = (worst.distance, worst.bodies) if worst else (None, ())
        ledger.add(STAGE, "ends", reason, value=value, limit=0.0, unit="m", bodies=bodies)
        return PathResult("none", reason, np.empty((0, len(world.robot.lower))), entries=ledger.entries)
    space: CSpaceSummary | None = None
    for attempt in _attempts(asked, rng, progress):
        space = attempt.space if len(attempt.points) or space is None else space
        entry = ledger.add(STAGE, attempt.needed or "three legs", attempt.reason or None, bodies=attempt.bodies)
        if len(attempt.points):
            result = _finished(asked, attempt, space, ledger, entry, rng)
            if result is not None:
                return result
        if attempt.proven or progress.cancelled:
            return _none(asked, attempt.reason if attempt.proven else "cancelled", ledger, space, attempt.proven)
    reasons = dict.fromkeys(entry.reason for entry in ledger.entries if entry.reason)
    return _none(asked, f"none is found with cells down to {min(asked.options.steps_deg):g}°: {'; '.join(reasons)}", ledger, space, False)


def _none(asked: Query, reason: str, ledger: Ledger, space: CSpaceSummary | None, proven: bool) -> PathResult:
    """No path, with the bodies of the world that the attempts met, and the one that the straight way meets."""
    world = asked.world
    fixed = {DEPTH_MAP, TABLE, OUTSIDE} | {thing.name for thing in (*world.blocks, *world.parts)}
    told = [entry.bodies for entry in ledger.entries] + [asked.free.obstacle(asked.start, asked.goal)]
    separating = tuple(name for name, _ in Counter(name for bodies in told for name in bodies if name in fixed).most_common())
    cancelled = reason == "cancelled"
    return PathResult(
        "none", reason, _nothing(asked), entries=ledger.entries, space=space, cancelled=cancelled, proven=proven, separating=separating
    )


def _attempts(asked: Query, rng: np.random.Generator, progress: Progress) -> Iterator[Attempt]:
    """What is tried, one after the other, what is cheap first: some growths of the random trees, and the proof that there is no path, cost
    less than finer cells.
    """
    if asked.options.straight and asked.free.moves(asked.start, asked.goal):
        yield Attempt("straight", np.array([asked.start, asked.goal]), [asked.free], None, "")
    ways = wrist_ways(asked, rng, 2)
    if not ways:
        yield Attempt("wrist", _nothing(asked), [], None, "the wrist finds no way to turn that keeps the hand off the arm")
    steps, growths, places = asked.options.steps_deg, asked.options.tree_growths, None
    for k, step in enumerate(steps):
        for needed, layers in _plans(asked, ways, step):
            progress.report(k / (len(steps) + 1), f"configuration space of the arm joints, {step:g}° cells")
            stack = layers()
            places = stack.places if stack.assumed is not None else places
            found = three_legs(asked, stack, rng, progress)
            needed = ", ".join(word for word in (needed, found.more) if word)
            yield Attempt(needed, found.points, found.movers, found.space, found.reason, bodies=found.bodies)
            if found.shut:
                break
        if k == 0 and growths:
            yield _trees(asked, min(FEW_GROWTHS, growths), places, rng, progress)
            if surely_apart(asked):
                why = "start and goal stay apart even where only what is wholly blocked is taken out"
                yield Attempt("proof", _nothing(asked), [], None, why, proven=True)
    if growths > FEW_GROWTHS:
        yield _trees(asked, growths, places, rng, progress)


def _trees(asked: Query, most: int, places: NDArray | None, rng: np.random.Generator, progress: Progress) -> Attempt:
    """Random trees that grow towards the places where the arm is free with the wrist as it is at either end."""
    points, movers, grown = grow_trees(asked, most, rng, progress, places)
    why = "" if len(points) else "the random trees did not meet"
    return Attempt(f"random trees, {grown} growths", points, movers, None, why)


def _plans(asked: Query, ways: list[tuple[str, NDArray]], step: float) -> Iterator[tuple[str, Callable[[], Layers]]]:
    """What is needed and the layers, with cells `step` [°] wide, in the order of their cost.

    The paper's one box; the wrist turned at one place, for which the layers of the ends must be built; and for all ways the tighter boxes
    of parts of the range. A held joint that turns moves the arm itself, so it turns at one place.
    """
    robot, coarse, width = asked.world.robot, asked.options.steps_deg[0], float(np.deg2rad(step))
    fine = "" if step == coarse else f"{step:g}° cells, "
    held = robot.holding(np.array([asked.start, asked.goal])) if any(holds_far(robot, way) for _, way in ways) else ""
    for name, way in ways:
        if not name and not fine and not held:
            yield "", lambda way=way: layers_of(asked, [way], width)
    for name, way in ways:
        words = f"{name}, " if name else ""
        yield f"{words}{fine}{held or 'the wrist turned'} at one place", lambda way=way: turned_at_one_place(asked, way, width)
    for name, way in ways if not held else ():
        words, parts = f"{name}, " if name else "", wrist_parts(way)
        words += f"{fine}a tighter wrist box for each of {len(parts)} parts of its way"
        yield words, lambda stretches=(way[:1], *parts, way[-1:]): layers_of(asked, list(stretches), width)


def _nothing(asked: Query) -> NDArray:
    return np.empty((0, len(asked.start)))


def _finished(
    asked: Query, found: Attempt, space: CSpaceSummary | None, ledger: Ledger, entry: int, rng: np.random.Generator
) -> PathResult | None:
    """The path shortened and with its certificate; None, with the reason in the ledger, when the proof of the whole fails."""
    route = shorten(Route(found.points, tuple(found.movers)), asked.free, asked.options.shortcuts, rng)
    if route.movers:
        curve, certificate = round_corners(route, asked.free, asked.world.robot.velocity)
    else:
        curve, certificate = None, certify_with(asked.leaving, route.points)
    if not certificate.proved:
        ledger.fall(
            entry, certificate.reason, value=certificate.least_clearance, limit=certificate.margin, unit="m", bodies=certificate.bodies
        )
        return None
    legs = _legs(route.points, asked.world.robot.other_index)
    return PathResult("found", "", route.points, certificate, legs, found.needed, ledger.entries, space, curve=curve)


def _legs(points: NDArray, others: NDArray) -> tuple[Leg, ...]:
    """Start: the wrist as at the start; goal: as at the goal; free: while it turns. Cut corners may have left one leg of three."""
    last = len(points) - 1
    same_start = np.abs(points[:, others] - points[0, others]).max(axis=1) < 1e-9
    same_goal = np.abs(points[:, others] - points[-1, others]).max(axis=1) < 1e-9
    if same_start.all():
        return (Leg("free", 0, last),)
    turning, arrived = int(np.argmin(same_start)) - 1, last - int(np.argmin(same_goal[::-1])) + 1
    legs = (Leg("start", 0, turning), Leg("free", turning, arrived), Leg("goal", arrived, last))
    return tuple(leg for leg in legs if leg.last > leg.first)
