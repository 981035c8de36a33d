"""Two random trees over all joints, grown towards each other (Kuffner & LaValle 2000), every branch proved."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Progress
from handey_studio.motion.certificate import Mover
from handey_studio.motion.query import Query

BRANCH_RAD = 0.6  # longest branch: short enough that a proof rarely fails, long enough to get somewhere
SHORT_RAD = 0.12  # tried where that fails: in a crowd
NEAR_RAD = 0.8  # every other growth is towards a posture this close around the tree's own root: out of the crowd that it stands in
AT_ONCE = 100  # growths between two reports


class Tree:
    """Proved ways from a root: nodes (n,) [rad] with their parents. The root's own branches are `at_root`'s to prove."""

    def __init__(self, root: NDArray, at_root: Mover, free: Mover) -> None:
        self.nodes, self.count, self.parents = np.array(root, float)[None].repeat(64, axis=0), 1, [-1]
        self.at_root, self.free = at_root, free

    def extend(self, target: NDArray, near: int | None = None) -> int:
        """Grows by one branch towards a posture, from node `near` or else the nearest; the new node, the nearest if it is there, or -1."""
        if near is None:
            near = int(np.abs(self.nodes[: self.count] - target).sum(axis=1).argmin())
        here = self.nodes[near].copy()
        step = target - here
        length = float(np.abs(step).max())
        if length < 1e-12:
            return near
        for longest in (BRANCH_RAD, SHORT_RAD):
            end = target if length <= longest else here + step * (longest / length)
            proved = (self.free if near else self.at_root).moves(here, end)
            if proved and (near or self.at_root is self.free or self.free.stands(end)):
                return self._add(end, near)
        return -1

    def branch(self, node: int) -> list[NDArray]:
        """From the root to a node."""
        way = []
        while node >= 0:
            way.append(self.nodes[node].copy())
            node = self.parents[node]
        return way[::-1]

    def _add(self, node: NDArray, parent: int) -> int:
        if self.count == len(self.nodes):
            self.nodes = np.concatenate([self.nodes, self.nodes])  # room: what is in it beyond `count` does not matter
        self.nodes[self.count] = node
        self.parents.append(parent)
        self.count += 1
        return self.count - 1


def grow_trees(
    query: Query, most: int, rng: np.random.Generator, progress: Progress, places: NDArray | None = None
) -> tuple[NDArray, list[Mover], int]:
    """Points (n, joints) of a path and the mover of each segment, both empty when the trees did not meet in `most`
    growths; and how often they grew. They grow towards postures near their roots and, where `places` (k, 3) [rad] of the arm joints are
    given, towards these with the wrist in any posture; else towards any at all.
    """
    trees = Tree(query.start, query.leaving, query.free), Tree(query.goal, query.arriving, query.free)
    lower, upper = _bounds(query)
    for growth in range(most):
        if growth % AT_ONCE == 0:
            progress.report(growth / most, f"random trees: {growth} growths, {trees[0].count + trees[1].count} postures")
            if progress.cancelled:
                break
            targets = _drawn(query, lower, upper, rng, places)
        met = _grow(trees, growth % 2, targets[growth % AT_ONCE])
        if met is not None:
            ways = [tree.branch(node) for tree, node in zip(trees, met, strict=True)]
            points = np.array(ways[0] + ways[1][::-1][1:])
            movers = [query.free] * (len(points) - 1)
            movers[0], movers[-1] = query.leaving, query.arriving
            return points, movers, growth + 1
    return np.empty((0, len(query.start))), [], most


def _grow(trees: tuple[Tree, Tree], turn: int, target: NDArray) -> tuple[int, int] | None:
    """Grows one tree towards a posture, and the other one after it as far as it gets; the nodes that met."""
    one, other = trees[turn], trees[1 - turn]
    new = one.extend(target)
    if new < 0:
        return None
    goal = one.nodes[new].copy()
    node = other.extend(goal)
    while node >= 0:
        if np.abs(other.nodes[node] - goal).max() < 1e-12:
            return (new, node) if turn == 0 else (node, new)
        node = other.extend(goal, node)
    return None


def _drawn(query: Query, lower: NDArray, upper: NDArray, rng: np.random.Generator, places: NDArray | None) -> NDArray:
    """Postures (AT_ONCE, n) to grow towards: for start tree and goal tree in turn, two anywhere, or at one of the places if there are
    any, and two near the tree's root.
    """
    anywhere = rng.uniform(lower, upper, (AT_ONCE, len(lower)))
    if places is not None and len(places):
        anywhere[:, query.world.robot.arm_index] = places[rng.integers(len(places), size=AT_ONCE)]
    roots = np.where((np.arange(AT_ONCE) % 2 == 0)[:, None], query.start, query.goal)
    near = np.clip(roots + rng.uniform(-NEAR_RAD, NEAR_RAD, anywhere.shape), lower, upper)
    return np.where((np.arange(AT_ONCE) % 4 < 2)[:, None], anywhere, near)


def _bounds(query: Query) -> tuple[NDArray, NDArray]:
    """Where postures are drawn: the joint limits, but no farther than half a turn from the ends."""
    low, high = np.minimum(query.start, query.goal) - np.pi, np.maximum(query.start, query.goal) + np.pi
    return np.maximum(low, query.world.robot.lower), np.minimum(high, query.world.robot.upper)
