"""Certificates of joint-linear paths, and the mover that checks single motions on the way to one."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handey_studio.base import BadInput
from handey_studio.motion.proof import PROVED, Motion, Verdict, prove
from handey_studio.motion.results import Certificate
from handey_studio.world import Held, World
from handey_studio.world.collision import ALLOWED_DEPTH_M, FAR_M, Bodies, Clearance, CollisionModel, Pairs, collision_model
from handey_studio.world.collision_queries import Hit, Scene

MARGIN_M = 0.001  # what free motions keep: the tolerance at which touching is told from not touching
TOUCH_STEP_RAD = 0.02  # pairs that may touch are looked at this often: an arm's length away that is 2 cm


@dataclass(eq=False)
class Mover:
    """One arm, with one thing held and one set of pairs that may touch: answers about configurations and straight motions."""

    model: CollisionModel
    opening: float
    held: Held | None
    allowed: tuple[tuple[str, ...], ...]
    margin: float

    @cached_property
    def bodies(self) -> Bodies:
        return self.model.bodies(self.held)

    @cached_property
    def scene(self) -> Scene:
        return self.model.scene(self.held, self.allowed)

    def clearance(self, q: NDArray, opening: float | None = None) -> Clearance:
        return self.model.clearance(q, self.opening if opening is None else opening, self.held, self.allowed)

    def stands(self, q: NDArray) -> bool:
        """Whether one configuration keeps the margin."""
        return self.model.in_contact(q, self.opening, self.held, self.allowed, self.margin) is None

    def moves(self, q_start: NDArray, q_end: NDArray, slack: NDArray | float = 0.0) -> bool:
        """Whether the straight motion between two configurations, and what is within `slack` [rad] of it, is proved to keep the margin."""
        return self.verdict(q_start, q_end, slack=slack).outcome == PROVED

    def obstacle(self, q_start: NDArray, q_end: NDArray) -> tuple[str, ...]:
        """The two bodies that keep the straight motion between two configurations from being proved; none when it is."""
        verdict = self.verdict(q_start, q_end)
        hit = Hit(*verdict.hit)
        return () if verdict.outcome == PROVED or hit.kind < 0 else self.model.pair(hit, self.bodies)

    def verdict(
        self,
        q_start: NDArray,
        q_end: NDArray,
        openings: tuple[float, float] | None = None,
        nearest: float = 0.0,
        slack: NDArray | float = 0.0,
    ) -> Verdict:
        start, end = openings or (self.opening, self.opening)
        # Copies: a read-only array is another type to the compiler, and would compile everything anew.
        ends = np.array(q_start, dtype=float), np.array(q_end, dtype=float)
        motion = Motion(*ends, float(start), float(end), np.zeros(len(ends[0])) + slack)
        return Verdict(*prove(self.model.chain, self.bodies.shapes, self.scene, motion, float(self.margin), float(nearest)))


def mover(world: World, opening: float, held: Held | None = None, allowed: Pairs = (), margin: float = MARGIN_M) -> Mover:
    """The mover of a world's arm. `opening` [m], `margin` [m]; pairs of names in `allowed` may touch."""
    return Mover(collision_model(world), float(opening), held, tuple(sorted(tuple(sorted(pair)) for pair in allowed)), margin)


def certify(
    world: World, q_rad: ArrayLike, opening: ArrayLike, held: Held | None = None, allowed: Pairs = (), margin: float = MARGIN_M
) -> Certificate:
    """The certificate of the joint-linear path q_rad (n, joints) [rad] with the fingers `opening` [m] apart, one number or (n,).

    All pairs but those in `allowed` are proved to stay `margin` [m] apart between the points as well as at them. Pairs in `allowed` are
    looked at every 0.02 rad and may overlap by up to 2 mm. A proof that fails comes back with the place and the bodies.
    """
    path = np.asarray(q_rad, dtype=float)
    if path.ndim != 2 or path.shape[1] != len(world.robot.lower) or len(path) == 0 or not np.isfinite(path).all():
        raise BadInput(f"a path must be finite angles (n ≥ 1, {len(world.robot.lower)}), this one has shape {path.shape}.")
    openings = np.broadcast_to(np.asarray(opening, dtype=float), len(path))
    mine = mover(world, float(openings[0]), held, allowed, margin)
    return certify_with(mine, path, openings)


def certify_with(mine: Mover, path: NDArray, openings: NDArray | None = None, slack: NDArray | None = None) -> Certificate:
    """The certificate of a path (n, joints) [rad] by a mover; `openings` (n,) [m] are the mover's own unless given.

    What is proved holds as far from each segment as its `slack` (n - 1, joints) [rad]; the least clearance is measured on the segments.
    """
    openings = np.full(len(path), mine.opening) if openings is None else openings
    if len(path) == 1:
        path, openings = np.repeat(path, 2, axis=0), np.repeat(openings, 2)
    slack = np.zeros_like(path) if slack is None else slack
    checks, least, at, bodies = 0, FAR_M, (0, 0.0), ()
    for k in range(len(path) - 1):
        pair = (float(openings[k]), float(openings[k + 1]))
        for end in (k, k + 1) if k == len(path) - 2 else (k,):
            clearance = mine.clearance(path[end], float(openings[end]))
            if clearance.distance < least:
                least, at, bodies = clearance.distance, (k, float(end - k)), clearance.bodies
        verdict = mine.verdict(path[k], path[k + 1], pair, max(least, 0.0), slack[k])
        checks += verdict.checks
        hit = Hit(*verdict.hit)
        if hit.kind >= 0:
            least, at, bodies = hit.distance, (k, verdict.at), mine.model.pair(hit, mine.bodies)
        reason = "" if verdict.outcome == PROVED else _failure(mine, path[k] + verdict.at * (path[k + 1] - path[k]), pair, verdict.at)
        touch = _touching(mine, path[k], path[k + 1], pair) if mine.allowed and not reason else None
        if touch is not None:
            least, at, bodies = -touch[1].allowed_depth, (k, touch[0]), touch[1].allowed_bodies
            reason = str(touch[1])
        if reason:
            return Certificate(float(least), at, bodies, False, mine.margin, checks, _pairs(mine), reason)
    return Certificate(float(least), at, bodies, True, mine.margin, checks, _pairs(mine))


def _failure(mine: Mover, q: NDArray, openings: tuple[float, float], t: float) -> str:
    clearance = mine.clearance(q, openings[0] + t * (openings[1] - openings[0]))
    return f"{clearance}, {mine.margin * 1e3:.1f} mm are kept"


def _touching(mine: Mover, start: NDArray, end: NDArray, openings: tuple[float, float]) -> tuple[float, Clearance] | None:
    """The first place of a segment where a pair that may touch overlaps too deeply."""
    steps = 1 + int(np.ceil(np.abs(end - start).max() / TOUCH_STEP_RAD))
    for t in np.linspace(0.0, 1.0, steps + 1):
        clearance = mine.model.clearance(
            start + t * (end - start), openings[0] + t * (openings[1] - openings[0]), mine.held, mine.allowed, limit=1e-9
        )
        if clearance.allowed_depth > ALLOWED_DEPTH_M:
            return float(t), clearance
    return None


def _pairs(mine: Mover) -> tuple[tuple[str, str], ...]:
    return tuple((pair[0], pair[-1]) for pair in mine.allowed)
