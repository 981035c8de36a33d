"""A* among the free cells of a stack of configuration spaces."""

import heapq

import numpy as np
from numba import njit
from numpy.typing import NDArray

STEPS = 28  # the 26 neighbours by face, edge or corner are numbers 0 to 26 without 13; 27 is the next layer, 13 the one before


def find_cells(blocked: NDArray, start: NDArray, goal: NDArray, greed: float = 1.0) -> NDArray:
    """Shortest way (k, 4) from cell to cell (layer, and the cells of the three joints) among those not blocked (layers, n1, n2, n3) bool.

    Neighbours share a face, an edge or a corner, or are the same cell of neighbouring layers, which costs nothing. Empty when there is
    none. Two free cells that share a corner hold it both, so the straight line between their centres stays in them. With a
    `greed` above 1 it is found sooner and at most so many times as long.
    """
    cost, parent = np.zeros(blocked.shape, np.float32), np.zeros(blocked.shape, np.int8)  # untouched memory costs nothing
    return _astar(blocked, np.array(start, dtype=np.int64), np.array(goal, dtype=np.int64), greed, cost, parent)


@njit(cache=True)
def _ahead(a: int, b: int, c: int, goal: NDArray) -> float:
    """Length of the way to the goal where nothing is blocked: diagonal steps as long as they help."""
    x, y, z = abs(a - goal[1]), abs(b - goal[2]), abs(c - goal[3])
    most, least = max(x, y, z), min(x, y, z)
    return 1.7320508 * least + 1.4142136 * (x + y + z - most - 2 * least) + (2 * most + least - x - y - z)


@njit(cache=True)
def _astar(blocked: NDArray, start: NDArray, goal: NDArray, greed: float, cost: NDArray, parent: NDArray) -> NDArray:
    """`cost` holds 1 + the cost so far, negative once settled, `parent` 1 + the number of the step; both zeros at first."""
    layers, n1, n2, n3 = blocked.shape
    cost[start[0], start[1], start[2], start[3]] = 1.0
    heap = [(0.0, start[0], start[1], start[2], start[3])]
    while len(heap) > 0:
        _, layer, i, j, k = heapq.heappop(heap)
        here = cost[layer, i, j, k]
        if here < 0.0:
            continue
        cost[layer, i, j, k] = -here
        if layer == goal[0] and i == goal[1] and j == goal[2] and k == goal[3]:
            return _trace(parent, start, goal)
        for step in range(STEPS):
            a, b, c, d = layer, i + step // 9 - 1, j + (step // 3) % 3 - 1, k + step % 3 - 1
            if step == 13 or step == 27:
                a, b, c, d = (layer - 1 if step == 13 else layer + 1), i, j, k
            if a < 0 or b < 0 or c < 0 or d < 0 or a >= layers or b >= n1 or c >= n2 or d >= n3 or blocked[a, b, c, d]:
                continue
            moved = abs(b - i) + abs(c - j) + abs(d - k)
            new = float(here) + (0.0 if moved == 0 else 1.0 if moved == 1 else 1.4142136 if moved == 2 else 1.7320508)
            old = cost[a, b, c, d]
            if old == 0.0 or new < old:
                cost[a, b, c, d] = new
                parent[a, b, c, d] = step + 1
                heapq.heappush(heap, (new + greed * _ahead(b, c, d, goal), a, b, c, d))
    return np.empty((0, 4), np.int64)


@njit(cache=True)
def _trace(parent: NDArray, start: NDArray, goal: NDArray) -> NDArray:
    cells = [(goal[0], goal[1], goal[2], goal[3])]
    a, i, j, k = goal[0], goal[1], goal[2], goal[3]
    while not (a == start[0] and i == start[1] and j == start[2] and k == start[3]):
        step = parent[a, i, j, k] - 1
        if step == 13 or step == 27:
            a -= -1 if step == 13 else 1
        else:
            i, j, k = i - (step // 9 - 1), j - ((step // 3) % 3 - 1), k - (step % 3 - 1)
        cells.append((a, i, j, k))
    out = np.empty((len(cells), 4), np.int64)
    for s in range(len(cells)):
        out[s, 0], out[s, 1], out[s, 2], out[s, 3] = cells[len(cells) - 1 - s]
    return out
