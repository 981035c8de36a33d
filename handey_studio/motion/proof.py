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

from handey_studio.base.compiled import put
from handey_studio.world.bounding_tree import box_gap
from handey_studio.world.collision_bodies import Obstacles, Shapes
from handey_studio.world.collision_queries import (
    CHECKED,
    Chain,
    Hit,
    Scene,
    body_distance,
    forward,
    least_clearance,
    nearest_obstacle,
)

PROVED, VIOLATED, UNDECIDED = 0, 1, 2
MAX_HALVINGS = 24  # one part in 16 million of a segment: distances there are constant to a nanometre
MEASURED = 5  # halvings down to which all distances are measured: from there on only what is not proved yet can be much nearer


class Motion(NamedTuple):
    """A joint-linear segment: both ends (n,) [rad], the hand's opening [m] at them, and how far (n,) [rad] the way may be off it."""

    start: NDArray
    end: NDArray
    opening_start: float
    opening_end: float
    slack: NDArray


class Verdict(NamedTuple):
    """What became of a segment: PROVED, VIOLATED or UNDECIDED, at which fraction and by which pair; distances measured."""

    outcome: int
    at: float
    hit: Hit
    checks: int


@njit(cache=True)
def _boxes(shapes: Shapes, poses: NDArray, opening: float) -> tuple[NDArray, NDArray]:
    """The bodies' boxes (b, 8, 3) [m] in the world, and the axis-aligned boxes (b, 2, 3) around these."""
    boxes, spans = np.empty_like(shapes.boxes), np.empty((len(shapes.link), 2, 3))
    for b in range(len(boxes)):
        T = poses[shapes.link[b]]
        u, v, w = shapes.slide[b, 0] * opening, shapes.slide[b, 1] * opening, shapes.slide[b, 2] * opening
        for axis in range(3):
            low, high = np.inf, -np.inf
            for k in range(8):
                x, y, z = shapes.boxes[b, k, 0] + u, shapes.boxes[b, k, 1] + v, shapes.boxes[b, k, 2] + w
                value = T[axis, 0] * x + T[axis, 1] * y + T[axis, 2] * z + T[axis, 3]
                boxes[b, k, axis] = value
                low, high = min(low, value), max(high, value)
            spans[b, 0, axis], spans[b, 1, axis] = low, high
    return boxes, spans


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
def reach_of_motion(shapes: Shapes, chain: Chain, poses: NDArray, boxes: NDArray, dq: NDArray, opened: float) -> NDArray:
    """Bounds (b, n) [m]: entry (b, i) how far body b, in its box (8, 3) in the world, moves against link i when every joint turns by up to
    dq (n,) [rad] and the hand opens or closes by up to `opened` [m]. Entry (b, 0) is its motion in the world.
    """
    out = np.zeros((len(shapes.link), len(dq)))
    for b in range(len(shapes.link)):
        u, v, w = shapes.slide[b, 0], shapes.slide[b, 1], shapes.slide[b, 2]
        moved = np.sqrt(u * u + v * v + w * w) * opened
        for joint in range(shapes.link[b] - 1, -1, -1):
            if dq[joint] > 0.0:
                moved += dq[joint] * (axis_distances(poses, chain, boxes[b], joint) + moved)
            out[b, joint] = moved
    return out


@njit(cache=True)
def _any_near(fixed: Obstacles, span: NDArray, row: NDArray, need: float) -> bool:
    """Whether the box of an obstacle that must be kept from is nearer than `need` [m] to a box (2, 3)."""
    tree, depth = fixed.tree, min(1, len(fixed.tree.left))
    todo = np.zeros(128, np.int64)
    while depth > 0:
        depth -= 1
        node = int(todo[depth])
        if box_gap(span[0], span[1], tree.low[node], tree.high[node]) >= need:
            continue
        if tree.left[node] >= 0:
            todo[depth], todo[depth + 1] = tree.right[node], tree.left[node]
            depth += 2
        elif row[fixed.name[tree.right[node]]] == CHECKED:
            return True
    return False


@njit(cache=True)
def _place(shapes: Shapes, poses: NDArray, opening: float, b: int, corners: NDArray, placed: NDArray) -> None:
    """Writes the corners [m] of one body in the world, if they are not there yet."""
    if placed[b]:
        return
    placed[b] = True
    T = poses[shapes.link[b]]
    u, v, w = shapes.slide[b, 0] * opening, shapes.slide[b, 1] * opening, shapes.slide[b, 2] * opening
    for c in range(shapes.first[b], shapes.first[b + 1]):
        x, y, z = shapes.corners[c, 0] + u, shapes.corners[c, 1] + v, shapes.corners[c, 2] + w
        for axis in range(3):
            corners[c, axis] = T[axis, 0] * x + T[axis, 1] * y + T[axis, 2] * z + T[axis, 3]


@njit(cache=True)
def _settle(
    shapes: Shapes,
    scene: Scene,
    place: tuple[NDArray, float, NDArray, NDArray],
    spans: NDArray,
    reach: NDArray,
    margin: float,
    open_bodies: NDArray,
    open_pairs: NDArray,
) -> tuple[bool, Hit]:
    """Strikes off the bodies and pairs that the middle proves for the whole interval; whether any is left, and the nearest of these.

    `place` are the link poses, the hand's opening, room for the bodies' corners and which are there: exact distances are asked for only
    where boxes come near.
    """
    poses, opening, corners, placed = place
    left, nearest = False, Hit(np.inf, -1, -1, -1)
    for b in range(len(shapes.link)):
        if not open_bodies[b]:
            continue
        need, row, first, last = margin + reach[b, 0], scene.rules[shapes.name[b]], shapes.first[b], shapes.first[b + 1]
        open_bodies[b] = False
        for kind in range(2):
            fixed = scene.solids if kind == 0 else scene.terrain
            if not _any_near(fixed, spans[b], row, need):
                continue
            _place(shapes, poses, opening, b, corners, placed)
            d, k = nearest_obstacle(corners, first, last, spans[b], fixed, row, CHECKED, need)
            if k >= 0:
                open_bodies[b], left = True, True
                if d < nearest.distance:
                    nearest = Hit(d, b, kind, k)
    for pair in range(len(shapes.pairs)):
        if not open_pairs[pair]:
            continue
        a, b = int(shapes.pairs[pair, 0]), int(shapes.pairs[pair, 1])
        need = margin + reach[b, shapes.link[a]]
        open_pairs[pair] = False
        if box_gap(spans[a, 0], spans[a, 1], spans[b, 0], spans[b, 1]) >= need:
            continue
        _place(shapes, poses, opening, a, corners, placed)
        _place(shapes, poses, opening, b, corners, placed)
        d = body_distance(shapes, corners, a, b, need)
        if d < need:
            open_pairs[pair], left = True, True
            if d < nearest.distance:
                nearest = Hit(d, b, 2, a)
    return left, nearest


@njit(cache=True)
def prove(chain: Chain, shapes: Shapes, scene: Scene, motion: Motion, margin: float, nearest: float) -> Verdict:
    """Whether every checked pair stays at least `margin` [m] apart on the whole segment, and as far beside it as its slack.

    `nearest` [m]: distances below it are measured, and the least returned with its place, if any; 0 to measure none. They are those of all
    pairs in coarse steps, and in finer ones of those pairs that come so near that coarse ones do not prove them.
    """
    bodies, pairs = len(shapes.link), len(shapes.pairs)
    dq = np.abs(motion.end - motion.start)
    opened = abs(motion.opening_end - motion.opening_start)
    open_bodies = np.zeros((MAX_HALVINGS + 2, bodies), np.bool_)
    open_pairs = np.zeros((MAX_HALVINGS + 2, pairs), np.bool_)
    put(shapes.link > 0, open_bodies[0])
    for pair in range(pairs):
        open_pairs[0, pair] = scene.rules[shapes.name[shapes.pairs[pair, 0]], shapes.name[shapes.pairs[pair, 1]]] == CHECKED
    starts, halvings = np.zeros(MAX_HALVINGS + 2), np.zeros(MAX_HALVINGS + 2, np.int64)
    depth, checks = 1, 0
    best, best_at = Hit(nearest, -1, -1, -1), 0.0
    corners, placed = np.empty_like(shapes.corners), np.zeros(bodies, np.bool_)
    while depth > 0:
        depth -= 1
        start, width = starts[depth], 0.5 ** halvings[depth]
        t = start + width / 2.0
        poses = forward(chain, motion.start + t * (motion.end - motion.start))
        opening = motion.opening_start + t * (motion.opening_end - motion.opening_start)
        boxes, spans = _boxes(shapes, poses, opening)
        placed[:] = False
        checks += 1
        if best.distance > 0.0 and halvings[depth] <= MEASURED:
            for b in range(bodies):
                _place(shapes, poses, opening, b, corners, placed)
            hit = least_clearance(shapes, corners, scene, best.distance)
            if hit.kind >= 0:
                best, best_at = hit, t
        reach = reach_of_motion(shapes, chain, poses, boxes, dq * (width / 2.0) + motion.slack, opened * width / 2.0)
        place = (poses, opening, corners, placed)
        left, hit = _settle(shapes, scene, place, spans, reach, margin, open_bodies[depth], open_pairs[depth])
        if not left:
            continue
        if hit.distance < best.distance:
            best, best_at = hit, t
        if hit.distance < margin:
            return Verdict(VIOLATED, t, hit, checks)
        if halvings[depth] == MAX_HALVINGS - 1:
            return Verdict(UNDECIDED, t, hit, checks)
        halvings[depth] += 1
        halvings[depth + 1] = halvings[depth]
        put(open_bodies[depth], open_bodies[depth + 1])
        put(open_pairs[depth], open_pairs[depth + 1])
        starts[depth], starts[depth + 1] = start + width / 2.0, start
        depth += 2
    return Verdict(PROVED, best_at, best, checks)
