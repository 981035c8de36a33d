"""A tree of axis-aligned boxes over many fixed convex bodies, so that a query looks at few of them."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray


class Tree(NamedTuple):
    """Node k spans `low[k]` to `high[k]` (n, 3) [m]; `left[k]`, `right[k]` are its halves, or -1 and the number of its one body."""

    low: NDArray
    high: NDArray
    left: NDArray
    right: NDArray


@njit(cache=True)
def build_tree(low: NDArray, high: NDArray) -> Tree:
    """The tree of k ≥ 1 boxes (k, 3) [m], halved at the median along the longest side of their centres."""
    k = len(low)
    nodes = max(2 * k - 1, 1)
    node_low, node_high = np.empty((nodes, 3)), np.empty((nodes, 3))
    left, right = np.full(nodes, -1, np.int64), np.full(nodes, -1, np.int64)
    order, centres = np.arange(k), (low + high) / 2.0
    todo, used = [(0, 0, k)], 1
    while len(todo) > 0:
        node, start, end = todo.pop()
        mine = order[start:end].copy()
        for axis in range(3):
            node_low[node, axis] = low[mine, axis].min()
            node_high[node, axis] = high[mine, axis].max()
        if end - start == 1:
            right[node] = mine[0]
            continue
        spread = np.array([centres[mine, axis].max() - centres[mine, axis].min() for axis in range(3)])
        order[start:end] = mine[np.argsort(centres[mine, np.argmax(spread)])]
        middle = (start + end) // 2
        left[node], right[node] = used, used + 1
        todo.append((used, start, middle))
        todo.append((used + 1, middle, end))
        used += 2
    return Tree(node_low, node_high, left, right)


@njit(cache=True)
def box_gap(low_a: NDArray, high_a: NDArray, low_b: NDArray, high_b: NDArray) -> float:
    """Distance [m] between two axis-aligned boxes; 0 when they overlap."""
    total = 0.0
    for axis in range(3):
        gap = max(low_a[axis] - high_b[axis], low_b[axis] - high_a[axis], 0.0)
        total += gap * gap
    return np.sqrt(total)
