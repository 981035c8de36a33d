"""Free ranges, free regions and how they hang together (Lozano-Pérez 1986: adjacent slices' free ranges that overlap are linked)."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray


class Regions(NamedTuple):
    """The free ranges of a stack of spaces (layers, n1, n2, n3), and the free regions that they link up to.

    Range r covers the cells `first[r]` to `last[r] - 1` of row `rows[r]` (3,): layer, cells of joints 1 and 2. `number` (r,) is its region,
    from 1 to `count`. Ranges are linked when cells of them touch by face, edge or corner within a layer, or are the same cell of two
    neighbouring layers.
    """

    rows: NDArray
    first: NDArray
    last: NDArray
    number: NDArray
    count: int


def free_regions(blocked: NDArray) -> Regions:
    """The regions of cells (layers, n1, n2, n3) bool that are not blocked."""
    rows, first, last, starts = _free_ranges(blocked)
    number, count = _link(rows, first, last, starts)
    return Regions(rows, first, last, number, int(count))


@njit(cache=True)
def _free_ranges(blocked: NDArray) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Rows, first and last cells of the free ranges in order; `starts` (layers, n1, n2 + 1) is where those of a row begin."""
    layers, n1, n2, n3 = blocked.shape
    found, starts = 0, np.zeros((layers, n1, n2 + 1), np.int64)
    for p in range(2):
        if p == 1:
            rows, first, last = np.empty((found, 3), np.int32), np.empty(found, np.int32), np.empty(found, np.int32)
        found = 0
        for a in range(layers):
            for i in range(n1):
                for j in range(n2):
                    starts[a, i, j] = found
                    row, m = blocked[a, i, j], 0
                    while m < n3:
                        if row[m]:
                            m += 1
                            continue
                        begin = m
                        while m < n3 and not row[m]:
                            m += 1
                        if p == 1:
                            rows[found, 0], rows[found, 1], rows[found, 2] = a, i, j
                            first[found], last[found] = begin, m
                        found += 1
                starts[a, i, n2] = found
    return rows, first, last, starts


@njit(cache=True)
def _root(parent: NDArray, r: int) -> int:
    while parent[r] != r:
        parent[r] = parent[parent[r]]
        r = parent[r]
    return r


@njit(cache=True)
def _join(parent: NDArray, first: NDArray, last: NDArray, r: int, begin: int, end: int, reach: int) -> None:
    """Links range r with the ranges `begin` to `end` of another row that come within `reach` cells of it."""
    for other in range(begin, end):
        if first[other] >= last[r] + reach:
            break
        if last[other] + reach > first[r]:
            a, b = _root(parent, r), _root(parent, other)
            parent[max(a, b)] = min(a, b)


@njit(cache=True)
def _link(rows: NDArray, first: NDArray, last: NDArray, starts: NDArray) -> tuple[NDArray, int]:
    """The region of each range, and their count."""
    n2 = starts.shape[2] - 1
    parent = np.arange(len(first))
    for r in range(len(first)):
        a, i, j = rows[r]
        for k in range(j - 1, j + 2):
            if i > 0 and 0 <= k < n2:
                _join(parent, first, last, r, int(starts[a, i - 1, k]), int(starts[a, i - 1, k + 1]), 1)
        if j > 0:
            _join(parent, first, last, r, int(starts[a, i, j - 1]), int(starts[a, i, j]), 1)
        if a > 0:
            _join(parent, first, last, r, int(starts[a - 1, i, j]), int(starts[a - 1, i, j + 1]), 0)
    number, count = np.zeros(len(first), np.int32), 0
    for r in range(len(first)):
        root = _root(parent, r)
        if root == r:
            count += 1
            number[r] = count
        else:
            number[r] = number[root]
    return number, count


@njit(cache=True)
def nearest_in_ranges(regions: Regions, layer: int, place: NDArray) -> tuple[NDArray, NDArray]:
    """Of each range of a layer the cell nearest to a place (3,), counted in cells from the first one's centre, and its distance squared.

    Ranges of other layers are infinitely far.
    """
    cells, squares = np.zeros(len(regions.first), np.int64), np.full(len(regions.first), np.inf)
    for r in range(len(cells)):
        if regions.rows[r, 0] == layer:
            x, y = regions.rows[r, 1] - place[0], regions.rows[r, 2] - place[1]
            cells[r] = min(max(int(np.round(place[2])), regions.first[r]), regions.last[r] - 1)
            z = cells[r] - place[2]
            squares[r] = x * x + y * y + z * z
    return cells, squares


def region_distances(regions: Regions, layer: int, place: NDArray) -> NDArray:
    """Distance (count,) [cells] from a place to each region's nearest cell in a layer; infinite where it has none there."""
    least = np.full(regions.count, np.inf)
    np.minimum.at(least, regions.number - 1, nearest_in_ranges(regions, layer, place)[1])
    return np.sqrt(least)


def nearest_cells(regions: Regions, layer: int, place: NDArray, region: int, count: int) -> NDArray:
    """Up to `count` cells (k, 3) of a region in a layer, nearest to a place first: one of each range, and from long ranges one amid.

    The nearest ones come densely, farther ones more and more thinly: neighbours mostly share one fate.
    """
    nearest, squares = nearest_in_ranges(regions, layer, place)
    mine = np.flatnonzero((regions.number == region) & np.isfinite(squares))
    if not len(mine):
        return np.empty((0, 3), int)
    order = mine[np.argsort(squares[mine], kind="stable")][: count * count]
    cells = np.column_stack([regions.rows[order, 1:], nearest[order]])
    amid = np.column_stack([regions.rows[order, 1:], (regions.first[order] + regions.last[order] - 1) // 2])
    cells = np.concatenate([cells, amid])
    cells = cells[np.unique(np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1)), return_index=True)[1]]
    cells = cells[np.argsort(((cells - place) ** 2).sum(axis=1), kind="stable")]
    keep = min(len(cells), count * count)
    return cells[np.unique(np.minimum((np.arange(count) ** 1.9).astype(int), keep - 1))]
