"""A question for a path: its ends, who may touch whom, and the movers that answer for its stretches."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.motion.certificate import MARGIN_M, Mover, certify_with, mover
from handey_studio.motion.results import Certificate
from handey_studio.world import Held, World
from handey_studio.world.collision import Clearance, Pairs


@dataclass(frozen=True)
class PathOptions:
    """What the path planner tries. Work is counted, never timed.

    `margin_m` what free motion keeps from everything; nearer an end that is closer already, half of that end's clearance.
    `straight` whether the straight way is looked at before a space is built.
    `steps_deg` widths of the cells, tried in turn; each divides a turn. `regions` free regions tried a space,
    `repairs` searches after the whole arm failed in some cells, `leg_growths` extensions of the random trees that look for a way of more
    legs from an end to the free space, `shortcuts` random short cuts tried, `tree_growths` extensions of the random trees over all joints,
    the last resort, before which a proof of none is sought; 0 for neither.
    """

    margin_m: float = MARGIN_M
    steps_deg: tuple[float, ...] = (5.0, 2.5)
    regions: int = 2
    repairs: int = 20
    leg_growths: int = 300
    straight: bool = True
    shortcuts: int = 40
    tree_growths: int = 20_000


@dataclass(frozen=True, eq=False)
class Query:
    """A path from `start` to `goal` (n,) [rad]. `leaving` speaks for the leg from the start, `free` for the middle, `arriving` for the
    leg to the goal; they are one and the same where no more is allowed at an end than in the middle.
    """

    world: World
    start: NDArray
    goal: NDArray
    opening: float
    held: Held | None
    leaving: Mover
    free: Mover
    arriving: Mover
    options: PathOptions


def query(
    world: World,
    start: NDArray,
    goal: NDArray,
    opening: float,
    held: Held | None,
    allowed_start: Pairs,
    allowed_goal: Pairs,
    options: PathOptions,
) -> tuple[Query, str, Clearance | None]:
    """The question; and why it has no answer at all, when an end is beyond a joint's limit or in collision, with what collides."""
    ends = [np.array(q, dtype=float) for q in (start, goal)]
    n = len(world.robot.lower)
    for name, q in zip(("start", "goal"), ends, strict=True):
        if q.shape != (n,) or not np.isfinite(q).all():
            raise BadInput(f"the {name} of a path must be {n} finite angles, this one has shape {q.shape}.")
    free = mover(world, opening, held, (), options.margin_m)
    speakers, reason, worst = [], "", None
    for name, q, allowed in (("start", ends[0], allowed_start), ("goal", ends[1], allowed_goal)):
        speaker, clearance = _speaker(free, q, tuple(tuple(pair) for pair in allowed))
        speakers.append(speaker)
        over = world.robot.limit_margin(q)
        if over < 0 and not reason:
            joint = world.robot.joint_names[int(np.argmin(np.minimum(q - world.robot.lower, world.robot.upper - q)))]
            reason = f"the {name} is {np.rad2deg(-over):.1f}° beyond the limit of {joint}"
        if not clearance.keeps() and not reason:
            reason, worst = f"the {name} is in collision: {clearance}", clearance
    asked = Query(world, ends[0], ends[1], float(opening), held, speakers[0], free, speakers[1], options)
    return asked, reason, worst


def _speaker(free: Mover, q: NDArray, allowed: tuple[tuple[str, ...], ...]) -> tuple[Mover, Clearance]:
    """The mover for the leg at one end: what is allowed there, and no more margin than half of what the end has."""
    end = replace(free, allowed=tuple(sorted(tuple(sorted(pair)) for pair in allowed)))
    clearance = end.clearance(q)
    margin = min(free.margin, max(clearance.distance, 0.0) / 2.0)
    return (free if not allowed and margin == free.margin else replace(end, margin=margin)), clearance


def certify_runs(points: NDArray, movers: list[Mover], slack: NDArray) -> Certificate:
    """One certificate for a path whose segments are spoken for by different movers: the least of all, with the smallest margin.

    `slack` (n - 1, joints) [rad]: how far the way may be from each segment.
    """
    total: Certificate | None = None
    first = 0
    for last in range(1, len(movers) + 1):
        if last < len(movers) and movers[last] is movers[first]:
            continue
        part = certify_with(movers[first], points[first : last + 1], slack=slack[first:last])
        part = replace(part, at=(part.at[0] + first, part.at[1]))
        total = part if total is None else _joined(total, part)
        first = last
        if not part.proved:
            break
    return total if total is not None else certify_with(movers[0], points, slack=slack)


def _joined(one: Certificate, other: Certificate) -> Certificate:
    closest = other if not other.proved or other.least_clearance < one.least_clearance else one
    pairs = tuple(sorted({*one.pairs_allowed, *other.pairs_allowed}))
    return replace(
        closest,
        proved=one.proved and other.proved,
        margin=min(one.margin, other.margin),
        checks=one.checks + other.checks,
        pairs_allowed=pairs,
    )
