"""The last resort: two random trees over all joints, grown towards each other (Kuffner & LaValle 2000), every branch proved."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Progress
from handey_studio.motion.certificate import Mover
from handey_studio.motion.query import Query

BRANCH_RAD = 0.6  # longest branch: short enough that a proof rarely fails, long enough to get somewhere


class _Tree:
    """Nodes (n, joints) with their parents. Branches at the root are spoken for by the root's own mover."""

    def __init__(self, root: NDArray, at_root: Mover, free: Mover) -> None:
        self.nodes, self.parents, self.at_root, self.free = [root], [-1], at_root, free

    def extend(self, towards: NDArray) -> int | None:
        """Grows by one branch towards a configuration; the new node, or None."""
        near = int(np.argmin(np.abs(np.array(self.nodes) - towards).sum(axis=1)))
        step = towards - self.nodes[near]
        length = float(np.abs(step).max())
        if length < 1e-12:
            return near
        end = self.nodes[near] + step * min(1.0, BRANCH_RAD / length)
        mover = self.at_root if near == 0 else self.free
        if not mover.moves(self.nodes[near], end) or (near == 0 and not self.free.stands(end)):
            return None
        self.nodes.append(end)
        self.parents.append(near)
        return len(self.nodes) - 1

    def branch(self, node: int) -> list[NDArray]:
        """From the root to a node."""
        way = []
        while node >= 0:
            way.append(self.nodes[node])
            node = self.parents[node]
        return way[::-1]


def grow_trees(query: Query, rng: np.random.Generator, progress: Progress) -> tuple[NDArray, list[Mover], int]:
    """Points (n, joints) of a path and the mover of each segment, both empty when the trees did not meet; and how often they grew."""
    trees = [_Tree(query.start, query.leaving, query.free), _Tree(query.goal, query.arriving, query.free)]
    lower, upper = _bounds(query)
    for growth in range(query.options.tree_growths):
        if growth % 50 == 0:
            progress.report(
                growth / query.options.tree_growths, f"random trees: {growth} growths, {sum(len(t.nodes) for t in trees)} postures"
            )
            if progress.cancelled:
                break
        one, other = trees[growth % 2], trees[1 - growth % 2]
        new = one.extend(rng.uniform(lower, upper))
        if new is None:
            continue
        met = _connect(other, one.nodes[new])
        if met is not None:
            ways = [one.branch(new), other.branch(met)][:: 1 if growth % 2 == 0 else -1]
            points = ways[0] + ways[1][::-1][1:]
            movers = [query.free] * (len(points) - 1)
            movers[0], movers[-1] = query.leaving, query.arriving
            return np.array(points), movers, growth + 1
    return np.empty((0, len(query.start))), [], query.options.tree_growths


def _connect(tree: _Tree, target: NDArray) -> int | None:
    """Grows a tree on and on towards a configuration; its node there, or None when it got stuck."""
    while (node := tree.extend(target)) is not None:
        if np.abs(tree.nodes[node] - target).max() < 1e-12:
            return node
    return None


def _bounds(query: Query) -> tuple[NDArray, NDArray]:
    """Where postures are drawn: the joint limits, but no farther than a turn from the ends."""
    low, high = np.minimum(query.start, query.goal) - np.pi, np.maximum(query.start, query.goal) + np.pi
    return np.maximum(low, query.world.robot.lower), np.minimum(high, query.world.robot.upper)
