"""The proof that a joint-linear motion keeps its margin everywhere, not only where one looks: compiled.

On an interval of the motion, each body stays within some distance of where it is in the interval's middle. What is
farther than that from every other body in the middle cannot come nearer than the margin anywhere on the interval; for the rest
the interval is halved. The bound on the motion moves the joints one by one, from the last to the first: a point at distance r
of an axis, displaced by D already, is moved by at most |Δq|·(r + D) more.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.world.collision_bodies import Shapes
from handey_studio.world.collision_queries import (
    CHECKED,
    Chain,
    Hit,
    Scene,
    body_distance,
    bounds,
    forward,
    least_clearance,
    nearest_obstacle,
    placed,
)

PROVED, VIOLATED, UNDECIDED = 0, 1, 2
MAX_HALVINGS = 24  # one part in 16 million of a segment: distances there are constant to a nanometre


class Motion(NamedTuple):
    """A joint-linear segment: both ends (n,) [rad], and the hand's opening [m] at them."""

    start: NDArray
    end: NDArray
    opening_start: float
    opening_end: float


class Verdict(NamedTuple):
    """What became of a segment: PROVED, VIOLATED or UNDECIDED, at which fraction and by which pair; distances measured."""

    outcome: int
    at: float
    hit: Hit
    checks: int


@njit(cache=True)
def axis_distances(poses: NDArray, chain: Chain, points: NDArray, joint: int) -> float:
    """Greatest distance [m] of points (k, 3) from the axis of a joint at the given link poses."""
    T, a = poses[joint + 1], chain.axes[joint]
    x = T[0, 0] * a[0] + T[0, 1] * a[1] + T[0, 2] * a[2]
    y = T[1, 0] * a[0] + T[1, 1] * a[1] + T[1, 2] * a[2]
    z = T[2, 0] * a[0] + T[2, 1] * a[1] + T[2, 2] * a[2]
    most = 0.0
    for k in range(len(points)):
        u, v, w = points[k, 0] - T[0, 3], points[k, 1] - T[1, 3], points[k, 2] - T[2, 3]
        along = u * x + v * y + w * z
        most = max(most, u * u + v * v + w * w - along * along)
    return np.sqrt(most)


@njit(cache=True)
def reach_of_motion(shapes: Shapes, chain: Chain, poses: NDArray, opening: float, dq: NDArray, opened: float) -> NDArray:
    """Bounds (b, n) [m]: entry (b, i) how far body b moves against link i when every joint turns by up to dq (n,) [rad] and the
    hand, `opening` apart, opens or closes by up to `opened` [m]. Entry (b, 0) is its motion in the world.
    """
    n = len(dq)
    out = np.zeros((len(shapes.link), n))
    box = np.empty((8, 3))
    for b in range(len(shapes.link)):
        link = shapes.link[b]
        T = poses[link]
        for k in range(8):
            for axis in range(3):
                box[k, axis] = T[axis, 3]
                for c in range(3):
                    box[k, axis] += T[axis, c] * (shapes.boxes[b, k, c] + shapes.slide[b, c] * opening)
        moved = np.sqrt((shapes.slide[b] ** 2).sum()) * opened
        for joint in range(link - 1, -1, -1):
            if dq[joint] > 0.0:
                moved += dq[joint] * (axis_distances(poses, chain, box, joint) + moved)
            out[b, joint] = moved
    return out


@njit(cache=True)
def _settle(
    shapes: Shapes, corners: NDArray, scene: Scene, reach: NDArray, margin: float, open_bodies: NDArray, open_pairs: NDArray
) -> bool:
    """Strikes off the bodies and pairs that the middle proves for the whole interval; whether any is left."""
    spans = bounds(shapes, corners)
    left = False
    for b in range(len(shapes.link)):
        if not open_bodies[b]:
            continue
        need = margin + reach[b, 0]
        row, first, last = scene.rules[shapes.name[b]], shapes.first[b], shapes.first[b + 1]
        _, k = nearest_obstacle(corners, first, last, spans[b], scene.solids, row, CHECKED, need)
        if k < 0:
            _, k = nearest_obstacle(corners, first, last, spans[b], scene.terrain, row, CHECKED, need)
        open_bodies[b] = k >= 0
        left |= k >= 0
    for pair in range(len(shapes.pairs)):
        if not open_pairs[pair]:
            continue
        a, b = int(shapes.pairs[pair, 0]), int(shapes.pairs[pair, 1])
        need = margin + reach[b, shapes.link[a]]
        open_pairs[pair] = body_distance(shapes, corners, a, b, need) < need
        left |= open_pairs[pair]
    return left


@njit(cache=True)
def prove(chain: Chain, shapes: Shapes, scene: Scene, motion: Motion, margin: float, nearest: float) -> Verdict:
    """Whether every checked pair stays at least `margin` [m] apart on the whole segment.

    `nearest` [m]: distances below it are measured and the least returned with its place, if any; 0 to measure none.
    """
    bodies, pairs = len(shapes.link), len(shapes.pairs)
    dq = np.abs(motion.end - motion.start)
    opened = abs(motion.opening_end - motion.opening_start)
    open_bodies = np.zeros((MAX_HALVINGS + 2, bodies), np.bool_)
    open_pairs = np.zeros((MAX_HALVINGS + 2, pairs), np.bool_)
    open_bodies[0] = shapes.link > 0
    for pair in range(pairs):
        open_pairs[0, pair] = scene.rules[shapes.name[shapes.pairs[pair, 0]], shapes.name[shapes.pairs[pair, 1]]] == CHECKED
    starts = np.zeros(MAX_HALVINGS + 2)
    halvings = np.zeros(MAX_HALVINGS + 2, np.int64)
    depth, checks = 1, 0
    best, best_at = Hit(nearest, -1, -1, -1), 0.0
    while depth > 0:
        depth -= 1
        start, width = starts[depth], 0.5 ** halvings[depth]
        t = start + width / 2.0
        poses = forward(chain, motion.start + t * (motion.end - motion.start))
        opening = motion.opening_start + t * (motion.opening_end - motion.opening_start)
        corners = placed(shapes, poses, opening)
        checks += 1
        if best.distance > 0.0:
            hit = least_clearance(shapes, corners, scene, best.distance)
            if hit.kind >= 0:
                best, best_at = hit, t
        reach = reach_of_motion(shapes, chain, poses, opening, dq * (width / 2.0), opened * width / 2.0)
        if not _settle(shapes, corners, scene, reach, margin, open_bodies[depth], open_pairs[depth]):
            continue
        hit = least_clearance(shapes, corners, scene, margin)
        if hit.kind >= 0:
            return Verdict(VIOLATED, t, hit, checks)
        if halvings[depth] == MAX_HALVINGS - 1:
            return Verdict(UNDECIDED, t, least_clearance(shapes, corners, scene, 1e3), checks)
        halvings[depth] += 1
        halvings[depth + 1] = halvings[depth]
        open_bodies[depth + 1], open_pairs[depth + 1] = open_bodies[depth], open_pairs[depth]
        starts[depth], starts[depth + 1] = start + width / 2.0, start
        depth += 2
    return Verdict(PROVED, best_at, best, checks)
