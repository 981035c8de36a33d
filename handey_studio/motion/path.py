"""Collision-free, certified paths between two configurations (Handey 1987 §4)."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Progress, Silent
from handey_studio.motion.certificate import Mover
from handey_studio.motion.query import PathOptions, Query, certify_runs, query
from handey_studio.motion.random_trees import grow_trees
from handey_studio.motion.results import CSpaceSummary, Leg, PathResult
from handey_studio.motion.shortcut import cut_corners, without_idle_points
from handey_studio.motion.three_legs import three_legs
from handey_studio.motion.wrist_ways import wrist_ways
from handey_studio.world import Held, World
from handey_studio.world.collision import Pairs

STAGE = "path"


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

    The paper's three legs in the slice configuration space, with 5° cells, then finer ones; then with the home wrist in
    between; then random trees over all joints. Pairs in `allowed_start` may touch on the leg that leaves the start, those in
    `allowed_goal` on the leg that arrives at the goal. No path found comes back as status "none" with every attempt in `entries`.
    Without `rng` the trees are drawn from seed 0.
    """
    options, progress = options or PathOptions(), progress or Silent()
    asked, reason, worst = query(world, start, goal, opening, held, allowed_start, allowed_goal, options)
    ledger = Ledger()
    if reason:
        value, bodies = (worst.distance, worst.bodies) if worst else (None, ())
        ledger.add(STAGE, "ends", reason, value=value, limit=0.0, unit="m", bodies=bodies)
        return PathResult("none", reason, np.empty((0, len(world.robot.lower))), entries=ledger.entries)
    space: CSpaceSummary | None = None
    for needed, points, movers, seen, why in _attempts(asked, rng or np.random.default_rng(0), progress):
        space = seen if len(points) or space is None else space
        entry = ledger.add(STAGE, needed or "three legs", why or None)
        if len(points):
            result = _finished(asked, points, movers, needed, ledger, entry, space)
            if result is not None:
                return result
        if progress.cancelled:
            return PathResult("none", "cancelled", np.empty((0, len(asked.start))), entries=ledger.entries, space=space, cancelled=True)
    reasons = dict.fromkeys(entry.reason for entry in ledger.entries if entry.reason)
    return PathResult("none", "; ".join(reasons), np.empty((0, len(asked.start))), entries=ledger.entries, space=space)


Attempt = tuple[str, NDArray, list[Mover], CSpaceSummary | None, str]


def _attempts(asked: Query, rng: np.random.Generator, progress: Progress) -> Iterator[Attempt]:
    """What is tried, one after the other: what beyond the paper it needed, its points, their movers, the space, why it fell."""
    steps = asked.options.steps_deg
    ways = wrist_ways(asked, rng, 2)
    plans = [(wrists, step, name) for step in steps for name, wrists in ways]
    if not ways:
        yield "wrist", np.empty((0, len(asked.start))), [], None, "the wrist finds no way to turn that keeps the hand off the arm"
    for k, (wrists, step, name) in enumerate(plans):
        progress.report(k / (len(plans) + 1), f"configuration space of the arm joints, {step:g}° cells")
        found = three_legs(asked, wrists, float(np.deg2rad(step)), fine=True)
        needed = ", ".join(word for word in (name, f"{step:g}° cells" if step != steps[0] else "") if word)
        yield needed, found.points, found.movers, found.space, found.reason
    points, movers, growths = grow_trees(asked, rng, progress)
    why = "" if len(points) else f"random trees did not meet in {growths} growths"
    yield f"random trees, {growths} growths", points, movers, None, why


def _finished(
    asked: Query, points: NDArray, movers: list[Mover], needed: str, ledger: Ledger, entry: int, space: CSpaceSummary | None
) -> PathResult | None:
    """The path with its corners cut and its certificate; None, with the reason in the ledger, when the proof of the whole fails."""
    points, movers = cut_corners(points, movers, asked.free, asked.options.cut_rounds)
    points, movers = without_idle_points(points, movers)
    if not movers:
        points, movers = np.array([asked.start, asked.goal]), [asked.leaving]
    certificate = certify_runs(points, movers)
    if not certificate.proved:
        ledger.fall(
            entry, certificate.reason, value=certificate.least_clearance, limit=certificate.margin, unit="m", bodies=certificate.bodies
        )
        return None
    return PathResult("found", "", points, certificate, _legs(points, asked.world.robot.other_index), needed, ledger.entries, space)


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
