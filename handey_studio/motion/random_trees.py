"""The last resort: two random trees over all joints, grown towards each other (Kuffner & LaValle 2000), every branch proved; compiled."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base import Progress
from handey_studio.motion.certificate import Mover
from handey_studio.motion.proof import PROVED, Motion, prove
from handey_studio.motion.query import Query
from handey_studio.world.collision_bodies import Shapes
from handey_studio.world.collision_queries import Chain, Scene

BRANCH_RAD = 0.6  # longest branch: short enough that a proof rarely fails, long enough to get somewhere
SHORT_RAD = 0.12  # tried where that fails: in a crowd
NEAR_RAD = 0.8  # every other growth is towards a posture this close around the tree's own root: out of the crowd that it stands in
AT_ONCE = 100  # growths between two reports


class Speaker(NamedTuple):
    """What a mover knows, for the compiled trees."""

    chain: Chain
    shapes: Shapes
    scene: Scene
    opening: float
    margin: float


class Tree(NamedTuple):
    """Nodes (most, n) [rad] with their parents (most,), of which `count[0]` are there. The root's own branches are `at_root`'s to prove."""

    nodes: NDArray
    parents: NDArray
    count: NDArray
    at_root: Speaker
    free: Speaker


def grow_trees(query: Query, most: int, rng: np.random.Generator, progress: Progress) -> tuple[NDArray, list[Mover], int]:
    """Points (n, joints) of a path and the mover of each segment, both empty when the trees did not meet in `most`
    growths; and how often they grew.
    """
    trees = (_tree(query.start, query.leaving, query.free, most), _tree(query.goal, query.arriving, query.free, most))
    lower, upper = _bounds(query)
    for growth in range(0, most, AT_ONCE):
        nodes = int(trees[0].count[0] + trees[1].count[0])
        progress.report(growth / most, f"random trees: {growth} growths, {nodes} postures")
        if progress.cancelled:
            break
        met = _grow(trees, _drawn(query, lower, upper, rng))
        if met[0] >= 0:
            ways = [_branch(tree, node) for tree, node in zip(trees, met, strict=True)]
            points = np.array(ways[0] + ways[1][::-1][1:])
            movers = [query.free] * (len(points) - 1)
            movers[0], movers[-1] = query.leaving, query.arriving
            return points, movers, growth + AT_ONCE
    return np.empty((0, len(query.start))), [], most


def _tree(root: NDArray, at_root: Mover, free: Mover, most: int) -> Tree:
    nodes, parents = np.empty((10 * most + 1000, len(root))), np.full(10 * most + 1000, -1)
    nodes[0] = root
    return Tree(nodes, parents, np.ones(1, np.int64), _speaker(at_root), _speaker(free))


def _speaker(mover: Mover) -> Speaker:
    return Speaker(mover.model.chain, mover.bodies.shapes, mover.scene, float(mover.opening), float(mover.margin))


def _drawn(query: Query, lower: NDArray, upper: NDArray, rng: np.random.Generator) -> NDArray:
    """Postures (AT_ONCE, n) to grow towards: for start tree and goal tree in turn, two anywhere and two near the tree's root."""
    anywhere = rng.uniform(lower, upper, (AT_ONCE, len(lower)))
    roots = np.where((np.arange(AT_ONCE) % 2 == 0)[:, None], query.start, query.goal)
    near = np.clip(roots + rng.uniform(-NEAR_RAD, NEAR_RAD, anywhere.shape), lower, upper)
    return np.where((np.arange(AT_ONCE) % 4 < 2)[:, None], anywhere, near)


def _branch(tree: Tree, node: int) -> list[NDArray]:
    """From the root to a node."""
    way = []
    while node >= 0:
        way.append(tree.nodes[node])
        node = int(tree.parents[node])
    return way[::-1]


@njit(cache=True)
def _moves(speaker: Speaker, start: NDArray, end: NDArray) -> bool:
    motion = Motion(start, end, speaker.opening, speaker.opening, np.zeros(len(start)))
    return prove(speaker.chain, speaker.shapes, speaker.scene, motion, speaker.margin, 0.0).outcome == PROVED


@njit(cache=True)
def _extend(tree: Tree, target: NDArray, near: int) -> int:
    """Grows by one branch towards a posture, from node `near` or else the nearest; the new node, the nearest if it is there, or -1."""
    count = int(tree.count[0])
    if near < 0:
        least = np.inf
        for node in range(count):
            gap = np.abs(tree.nodes[node] - target).sum()
            if gap < least:
                least, near = gap, node
    step = target - tree.nodes[near]
    length = np.abs(step).max()
    if length < 1e-12:
        return near
    if count >= len(tree.nodes):
        return -1
    for longest in (BRANCH_RAD, SHORT_RAD):
        end = target.copy() if length <= longest else tree.nodes[near] + step * (longest / length)
        proved = _moves(tree.at_root if near == 0 else tree.free, tree.nodes[near].copy(), end)
        if proved and (near > 0 or _moves(tree.free, end, end)):
            tree.nodes[count], tree.parents[count] = end, near
            tree.count[0] = count + 1
            return count
    return -1


@njit(cache=True)
def _grow(trees: tuple[Tree, Tree], targets: NDArray) -> tuple[int, int]:
    """Grows the trees in turn towards each of the targets (k, n), and the other one after it; the nodes that met, or -1 twice."""
    for growth in range(len(targets)):
        one, other = (trees[0], trees[1]) if growth % 2 == 0 else (trees[1], trees[0])
        new = _extend(one, targets[growth], -1)
        if new < 0:
            continue
        goal = one.nodes[new].copy()
        node = _extend(other, goal, -1)
        while node >= 0:
            if np.abs(other.nodes[node] - goal).max() < 1e-12:
                return (new, node) if growth % 2 == 0 else (node, new)
            node = _extend(other, goal, node)
    return -1, -1


def _bounds(query: Query) -> tuple[NDArray, NDArray]:
    """Where postures are drawn: the joint limits, but no farther than half a turn from the ends."""
    low, high = np.minimum(query.start, query.goal) - np.pi, np.maximum(query.start, query.goal) + np.pi
    return np.maximum(low, query.world.robot.lower), np.minimum(high, query.world.robot.upper)
