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


NOWHERE = Tree(*np.empty((2, 0, 3)), *np.empty((2, 0), np.int64))  # the tree of no boxes


def build_tree(low: NDArray, high: NDArray) -> Tree:
    """The tree of k ≥ 1 boxes (k, 3) [m]: complete, over the boxes in Morton order of their centres, so that neighbours share nodes.

    Leaves that fill it up to a power of two are nowhere: infinitely far from everything.
    """
    k = len(low)
    leaves = 1 << int(np.ceil(np.log2(k)))
    lows, highs = [np.full((leaves, 3), np.inf)], [np.full((leaves, 3), np.inf)]
    order = np.argsort(_morton((low + high) / 2.0), kind="stable")
    lows[0][:k], highs[0][:k] = low[order], high[order]
    while len(lows[0]) > 1:
        one, other = highs[0][::2], highs[0][1::2]
        lows.insert(0, np.minimum(lows[0][::2], lows[0][1::2]))
        highs.insert(0, np.where(np.isinf(other), one, np.maximum(one, other)))
    inner = np.arange(leaves - 1)
    left = np.concatenate([2 * inner + 1, np.full(leaves, -1)])
    right = np.concatenate([2 * inner + 2, order, np.full(leaves - k, -1)])
    return Tree(np.concatenate(lows), np.concatenate(highs), left, right)


def _morton(centres: NDArray) -> NDArray:
    """Numbers (k,) whose order keeps neighbours together: the bits of the three coordinates, on a grid of 1024, taken in turn."""
    low = centres.min(axis=0)
    grid = ((centres - low) / max(float(np.ptp(centres, axis=0).max()), 1e-12) * 1023).astype(np.int64)
    code = np.zeros(len(centres), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((grid[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code


@njit(cache=True)
def box_gap(low_a: NDArray, high_a: NDArray, low_b: NDArray, high_b: NDArray) -> float:
    """Distance [m] between two axis-aligned boxes; 0 when they overlap."""
    total = 0.0
    for axis in range(3):
        gap = max(low_a[axis] - high_b[axis], low_b[axis] - high_a[axis], 0.0)
        total += gap * gap
    return np.sqrt(total)
