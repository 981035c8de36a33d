"""Compiled collision queries over the flat arrays of `collision_bodies`."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base.compiled import put
from handey_studio.world.bounding_tree import box_gap
from handey_studio.world.collision_bodies import Obstacles, Shapes
from handey_studio.world.gjk import distance

CHECKED, ALLOWED = 0, 1  # what `rules[a, b]` says of two names: keep apart, may touch


class Chain(NamedTuple):
    """The arm's joints: placement of the base, of each joint in the link before it at zero, and its axis."""

    T_base: NDArray
    T_links: NDArray
    axes: NDArray


class Scene(NamedTuple):
    """The fixed bodies: known solids and the depth map's columns, and which names may meet."""

    solids: Obstacles
    terrain: Obstacles
    rules: NDArray


class Hit(NamedTuple):
    """A distance [m], the moving body that it belongs to, and the other: `kind` 0 a solid, 1 a column, 2 a moving body, -1 none."""

    distance: float
    body: int
    kind: int
    other: int


@njit(cache=True)
def _product(S: NDArray, T: NDArray, out: NDArray) -> None:
    for i in range(4):
        for j in range(4):
            out[i, j] = S[i, 0] * T[0, j] + S[i, 1] * T[1, j] + S[i, 2] * T[2, j] + S[i, 3] * T[3, j]


@njit(cache=True)
def forward(chain: Chain, q: NDArray) -> NDArray:
    """Ts_world_link (n + 1, 4, 4) of the base and each moving link at q (n,) [rad]."""
    n = len(q)
    poses, hinge, turn = np.zeros((n + 1, 4, 4)), np.zeros((4, 4)), np.zeros((4, 4))
    for row in range(4):
        put(chain.T_base[row], poses[0, row])
    turn[3, 3] = 1.0
    for i in range(n):
        x, y, z = chain.axes[i]
        s, c = np.sin(q[i]), np.cos(q[i])
        v = 1.0 - c
        turn[0, 0], turn[0, 1], turn[0, 2] = c + x * x * v, x * y * v - z * s, x * z * v + y * s
        turn[1, 0], turn[1, 1], turn[1, 2] = y * x * v + z * s, c + y * y * v, y * z * v - x * s
        turn[2, 0], turn[2, 1], turn[2, 2] = z * x * v - y * s, z * y * v + x * s, c + z * z * v
        _product(poses[i], chain.T_links[i], hinge)
        _product(hinge, turn, poses[i + 1])
    return poses


@njit(cache=True)
def placed(shapes: Shapes, poses: NDArray, opening: float) -> NDArray:
    """Corners (v, 3) [m] of all bodies in the world."""
    out = np.empty_like(shapes.corners)
    for b in range(len(shapes.link)):
        T = poses[shapes.link[b]]
        u, v, w = shapes.slide[b, 0] * opening, shapes.slide[b, 1] * opening, shapes.slide[b, 2] * opening
        for i in range(shapes.first[b], shapes.first[b + 1]):
            x, y, z = shapes.corners[i, 0] + u, shapes.corners[i, 1] + v, shapes.corners[i, 2] + w
            for axis in range(3):
                out[i, axis] = T[axis, 0] * x + T[axis, 1] * y + T[axis, 2] * z + T[axis, 3]
    return out


@njit(cache=True)
def bounds(shapes: Shapes, corners: NDArray) -> NDArray:
    """Lower and upper corners (b, 2, 3) [m] of each placed body."""
    out = np.empty((len(shapes.link), 2, 3))
    for b in range(len(out)):
        for axis in range(3):
            low, high = np.inf, -np.inf
            for i in range(shapes.first[b], shapes.first[b + 1]):
                low, high = min(low, corners[i, axis]), max(high, corners[i, axis])
            out[b, 0, axis], out[b, 1, axis] = low, high
    return out


@njit(cache=True)
def _box_distance(corners: NDArray, first: int, last: int, low: NDArray, high: NDArray, box: NDArray, limit: float) -> float:
    """Distance [m] of one placed body to an axis-aligned box, whose corners are written to `box` (8, 3); some value ≥ `limit` when that is
    certain. A long body's own box holds far more of the depth map's columns than come near the body.
    """
    for k in range(8):
        for axis in range(3):
            box[k, axis] = high[axis] if (k >> axis) & 1 else low[axis]
    return distance(corners, first, last, box, 0, 8, limit)


@njit(cache=True)
def nearest_obstacle(
    corners: NDArray, first: int, last: int, span: NDArray, fixed: Obstacles, rules: NDArray, rule: int, limit: float
) -> tuple[float, int]:
    """Distance [m] of one placed body to the nearest obstacle under `rule`, and its number; (limit, -1) when none is nearer than `limit`.

    `rules` is the row of the body's name. Ends at the first obstacle that it meets.
    """
    best, found = limit, -1
    tree = fixed.tree
    if len(tree.left) == 0:
        return best, found
    todo, box = np.empty(128, np.int64), np.empty((8, 3))
    todo[0], depth = 0, 1
    while depth > 0:
        depth -= 1
        node = int(todo[depth])
        if box_gap(span[0], span[1], tree.low[node], tree.high[node]) >= best:
            continue
        if tree.left[node] < 0:
            k = int(tree.right[node])
            if rules[fixed.name[k]] == rule:
                d = distance(corners, first, last, fixed.corners, fixed.first[k], fixed.first[k + 1], best)
                if d < best:
                    best, found = d, k
                if best <= 0.0:
                    return best, found
            continue
        if _box_distance(corners, first, last, tree.low[node], tree.high[node], box, best) >= best:
            continue
        near, far = tree.left[node], tree.right[node]
        if box_gap(span[0], span[1], tree.low[far], tree.high[far]) < box_gap(span[0], span[1], tree.low[near], tree.high[near]):
            near, far = far, near
        todo[depth], todo[depth + 1] = far, near
        depth += 2
    return best, found


@njit(cache=True)
def body_distance(shapes: Shapes, corners: NDArray, a: int, b: int, limit: float) -> float:
    """Distance [m] of two moving bodies; some value ≥ `limit` when that much is certain."""
    return distance(corners, shapes.first[a], shapes.first[a + 1], corners, shapes.first[b], shapes.first[b + 1], limit)


@njit(cache=True)
def least_clearance(shapes: Shapes, corners: NDArray, scene: Scene, limit: float) -> Hit:
    """The nearest checked pair, if any is nearer than `limit`; distance 0 where two bodies meet.

    The fixed base is not held against the scene.
    """
    spans = bounds(shapes, corners)
    hit = Hit(limit, -1, -1, -1)
    for b in range(len(shapes.link) - 1, -1, -1):
        if shapes.link[b] == 0:
            continue
        row = scene.rules[shapes.name[b]]
        first, last = shapes.first[b], shapes.first[b + 1]
        d, k = nearest_obstacle(corners, first, last, spans[b], scene.solids, row, CHECKED, hit.distance)
        if k >= 0:
            hit = Hit(d, b, 0, k)
        d, k = nearest_obstacle(corners, first, last, spans[b], scene.terrain, row, CHECKED, hit.distance)
        if k >= 0:
            hit = Hit(d, b, 1, k)
        if hit.distance <= 0.0:
            return hit
    for pair in range(len(shapes.pairs)):
        a, b = int(shapes.pairs[pair, 0]), int(shapes.pairs[pair, 1])
        if scene.rules[shapes.name[a], shapes.name[b]] != CHECKED:
            continue
        if box_gap(spans[a, 0], spans[a, 1], spans[b, 0], spans[b, 1]) >= hit.distance:
            continue
        d = body_distance(shapes, corners, a, b, hit.distance)
        if d < hit.distance:
            hit = Hit(d, b, 2, a)
    return hit


@njit(cache=True)
def allowed_overlaps(shapes: Shapes, corners: NDArray, scene: Scene) -> NDArray:
    """Every fixed body that a moving body may touch and does meet: rows (n, 3) of `Hit`'s body, kind and other."""
    spans = bounds(shapes, corners)
    hits, count = np.empty((64, 3), np.int64), 0
    todo = np.empty(128, np.int64)
    for b in range(len(shapes.link)):
        row = scene.rules[shapes.name[b]]
        if shapes.link[b] == 0 or not (row == ALLOWED).any():
            continue
        for kind in range(2):
            fixed = scene.solids if kind == 0 else scene.terrain
            todo[0], depth = 0, min(1, len(fixed.tree.left))
            while depth > 0:
                depth -= 1
                node = int(todo[depth])
                if box_gap(spans[b, 0], spans[b, 1], fixed.tree.low[node], fixed.tree.high[node]) > 0.0:
                    continue
                k = int(fixed.tree.right[node])
                if fixed.tree.left[node] >= 0:
                    todo[depth], todo[depth + 1] = fixed.tree.left[node], k
                    depth += 2
                elif row[fixed.name[k]] == ALLOWED and _meet(shapes, corners, b, fixed, k):
                    if count == len(hits):
                        hits = np.concatenate((hits, np.empty_like(hits)))
                    hits[count, 0], hits[count, 1], hits[count, 2] = b, kind, k
                    count += 1
    return hits[:count]


@njit(cache=True)
def _meet(shapes: Shapes, corners: NDArray, b: int, fixed: Obstacles, k: int) -> bool:
    return distance(corners, shapes.first[b], shapes.first[b + 1], fixed.corners, fixed.first[k], fixed.first[k + 1], 1e-9) <= 0.0
