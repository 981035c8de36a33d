"""Searching the configuration space: the nearest free cells, and A* among the cells of a free region."""

import heapq

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.motion.configuration_space import ConfigurationSpace


def nearest_free(space: ConfigurationSpace, q: NDArray, region: int, count: int) -> NDArray:
    """Up to `count` cells (k, 3) of a free region, nearest to the arm joints of q first.

    The nearest ones come densely, farther ones more and more thinly: neighbours mostly share one fate.
    """
    cells = np.argwhere(space.regions == region)
    if not len(cells):
        return cells
    distances = np.linalg.norm(space.centre(cells) - np.asarray(q)[space.joints], axis=1)
    keep = min(len(cells), count * count)
    order = np.argpartition(distances, keep - 1)[:keep]
    order = order[np.argsort(distances[order], kind="stable")]
    return cells[order[np.unique(np.minimum((np.arange(count) ** 1.9).astype(int), keep - 1))]]


def regions_by_distance(space: ConfigurationSpace, q_start: NDArray, q_goal: NDArray, most: int) -> list[int]:
    """Free regions, those that come nearest to start and goal together first."""
    count = int(space.regions.max())
    if count == 0:
        return []
    least = []
    for q in (q_start, q_goal):
        a, b, c = ((centres - angle) ** 2 for centres, angle in zip(space.centres, np.asarray(q)[space.joints], strict=True))
        least.append(np.sqrt(_least_squares(np.array(space.regions), count, a, b, c)))
    total = least[0] + least[1]
    order = np.argsort(total, kind="stable")
    return [int(k) + 1 for k in order[:most]]


@njit(cache=True)
def _least_squares(regions: NDArray, count: int, a: NDArray, b: NDArray, c: NDArray) -> NDArray:
    """The least a[i] + b[j] + c[k] among the cells of each region."""
    least = np.full(count, np.inf)
    for i in range(len(a)):
        for j in range(len(b)):
            for k in range(len(c)):
                number = regions[i, j, k]
                if number > 0:
                    least[number - 1] = min(least[number - 1], a[i] + b[j] + c[k])
    return least


def find_cells(blocked: NDArray, start: tuple[int, int, int], goal: tuple[int, int, int]) -> NDArray:
    """Shortest way (k, 3) from cell to cell among free ones, neighbours by face, edge or corner; empty when there is none.

    Two free cells that share a corner hold it both, so the straight line between their centres stays in them.
    """
    return _astar(np.array(blocked), np.array(start, dtype=np.int64), np.array(goal, dtype=np.int64))


@njit(cache=True)
def _astar(blocked: NDArray, start: NDArray, goal: NDArray) -> NDArray:
    n1, n2, n3 = blocked.shape
    cost = np.full((n1, n2, n3), np.inf, np.float32)
    parent = np.full((n1, n2, n3), -1, np.int8)
    closed = np.zeros((n1, n2, n3), np.bool_)
    cost[start[0], start[1], start[2]] = 0.0
    heap = [(0.0, start[0], start[1], start[2])]
    while len(heap) > 0:
        _, i, j, k = heapq.heappop(heap)
        if closed[i, j, k]:
            continue
        closed[i, j, k] = True
        if i == goal[0] and j == goal[1] and k == goal[2]:
            return _trace(parent, start, goal)
        for move in range(27):
            a, b, c = i + move // 9 - 1, j + (move // 3) % 3 - 1, k + move % 3 - 1
            if a < 0 or b < 0 or c < 0 or a >= n1 or b >= n2 or c >= n3 or blocked[a, b, c] or closed[a, b, c]:
                continue
            step = np.sqrt(float((a - i) ** 2 + (b - j) ** 2 + (c - k) ** 2))
            new = cost[i, j, k] + step
            if new < cost[a, b, c]:
                cost[a, b, c] = new
                parent[a, b, c] = move
                ahead = np.sqrt(float((a - goal[0]) ** 2 + (b - goal[1]) ** 2 + (c - goal[2]) ** 2))
                heapq.heappush(heap, (new + ahead, a, b, c))
    return np.empty((0, 3), np.int64)


@njit(cache=True)
def _trace(parent: NDArray, start: NDArray, goal: NDArray) -> NDArray:
    cells = [(goal[0], goal[1], goal[2])]
    i, j, k = goal[0], goal[1], goal[2]
    while not (i == start[0] and j == start[1] and k == start[2]):
        move = parent[i, j, k]
        i, j, k = i - (move // 9 - 1), j - ((move // 3) % 3 - 1), k - (move % 3 - 1)
        cells.append((i, j, k))
    out = np.empty((len(cells), 3), np.int64)
    for s in range(len(cells)):
        out[s, 0], out[s, 1], out[s, 2] = cells[len(cells) - 1 - s]
    return out
