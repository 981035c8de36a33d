"""Which cells of one row are free, while one joint turns the arm's balls around their circles; compiled.

At a cell's centre a ball needs as much clearance as half a cell of each joint can move it. What it has beyond that lasts for some cells
more, and so does what it lacks: a row is looked at in strides, and the cost grows with the surface of what is forbidden, not with the cells
in it. A cell is FREE, or in DOUBT when it is not wholly free, or SOLID when already its centre collides.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base.compiled import put
from handey_studio.motion.circles import Circles, image, need_at, needs, stretch_of
from handey_studio.motion.distance_field import Field, clearance_at

FREE, DOUBT, SOLID = 0, 1, 2
LACKING = 3  # while a row is looked at: what was in doubt and is not free; what stays in doubt becomes free
BITS = 32  # of balls that lack clearance; those whose numbers differ by as many share theirs


class Work(NamedTuple):
    """Room for what is found out on the way: the `need` (k, n) [m] of each ball at each angle; which groups' small balls are in it, `known`
    (groups,); two sets of cells of a row (n,); and which small balls lack clearance in each, `lacking` (n,) uint32, a bit for each.
    """

    need: NDArray
    known: NDArray
    around: NDArray
    near: NDArray
    lacking: NDArray


@njit(cache=True)
def room(balls: int, groups: int, angles: int) -> Work:
    """Room for the work on rows of so many angles."""
    sets = np.empty(angles, np.bool_), np.empty(angles, np.bool_)
    return Work(np.empty((balls, angles)), np.zeros(groups, np.bool_), sets[0], sets[1], np.zeros(angles, np.uint32))


@njit(cache=True)
def bit_of(ball: int) -> np.uint32:
    """The bit of a small ball."""
    return np.uint32(np.uint32(1) << np.uint32(ball % BITS))


@njit(cache=True)
def march(
    field: Field,
    T: NDArray,
    local: NDArray,
    these: Circles,
    turns: NDArray,
    before: NDArray,
    step: float,
    tell: bool,
    work: Work,
    row: NDArray,
) -> None:
    """Settles those cells of a row (n,) that are in doubt. With `tell` solid ones are told from those that stay in doubt, and which balls
    lack clearance in these.

    Its circles are `local` (k, 9) in a frame that T (4, 4) maps to the world. The ball around all goes first, then that of each group; the
    small ones look only where it lacks clearance, and their needs are filled in when first asked for.
    """
    begin, end = _doubtful(row)
    if begin == end:
        return
    groups = len(these.first) - 1
    small, top = len(local) - groups - 1, len(local) - 1
    for m in range(begin, end):
        work.around[m] = row[m] == DOUBT
    work.lacking[:] = 0
    if _lacks(field, T, local, these.distance, top, turns, work.need, step, work.around, work.near, begin, end):
        put(work.near[begin:end], work.around[begin:end])
        for group in range(groups):
            first, last = these.first[group], these.first[group + 1]
            if not _lacks(field, T, local, these.distance, small + group, turns, work.need, step, work.around, work.near, begin, end):
                continue
            if not work.known[group]:
                needs(local, these, first, last, turns, before, step / 2, work.need)
                work.known[group] = True
            for s in range(first, last):
                _mark(field, T, local, these, s, turns, step, tell, work, row, begin, end)
    _settle(row, begin, end)


@njit(cache=True)
def refine(
    field: Field,
    T: NDArray,
    local: NDArray,
    these: Circles,
    turns: NDArray,
    before: NDArray,
    step: float,
    lacking: NDArray,
    halved: int,
    row: NDArray,
) -> None:
    """Settles those cells of a row (n,) that are in doubt, looking only at the small balls that are `lacking` clearance in the widest cells
    (n / 2^halved,) around them: what a ball has there it has in all of it.
    """
    begin, end = _doubtful(row)
    together = np.uint32(0)
    for m in range(begin, end):
        if row[m] == DOUBT:
            together |= lacking[m >> halved]
    for s in range(these.first[-1]):
        if not together & bit_of(s):
            continue
        x, y, z = image(T, local, s, 0, 1.0)
        a, b, c = image(T, local, s, 3, 0.0)
        u, v, w = image(T, local, s, 6, 0.0)
        start, stretch = step / 2 * these.distance[s] + these.slack[s], stretch_of(these.distance[s], step)
        m = begin
        while m < end:
            if row[m] != DOUBT or not lacking[m >> halved] & bit_of(s):
                m += 1
                continue
            p, q = turns[m, 0], turns[m, 1]
            over = clearance_at(field, x + p * a + q * u, y + p * b + q * v, z + p * c + q * w) - these.radius[s]
            over -= need_at(local[s], start, p, q, before, step / 2)
            if over < 0.0:
                row[m] = LACKING
            m += 1 + int(min(max(over, 0.0) * stretch, float(end)))
    _settle(row, begin, end)


@njit(cache=True)
def _settle(row: NDArray, begin: int, end: int) -> None:
    """What stayed in doubt is free, what lacks clearance in doubt."""
    for m in range(begin, end):
        row[m] = FREE if row[m] == DOUBT else DOUBT if row[m] == LACKING else row[m]


@njit(cache=True)
def _doubtful(row: NDArray) -> tuple[int, int]:
    """From where to where a row has cells in doubt."""
    begin, end = 0, len(row)
    while begin < end and row[begin] != DOUBT:
        begin += 1
    while end > begin and row[end - 1] != DOUBT:
        end -= 1
    return begin, end


@njit(cache=True)
def _lacks(
    field: Field,
    T: NDArray,
    local: NDArray,
    distance: NDArray,
    s: int,
    turns: NDArray,
    need: NDArray,
    step: float,
    cells: NDArray,
    lacking: NDArray,
    begin: int,
    end: int,
) -> bool:
    """Marks as `lacking` (n,) those of the cells (n,) from `begin` to `end` in which a big ball lacks clearance; whether any does."""
    x, y, z = image(T, local, s, 0, 1.0)
    a, b, c = image(T, local, s, 3, 0.0)
    u, v, w = image(T, local, s, 6, 0.0)
    found, m, stretch = False, begin, stretch_of(distance[s], step)
    lacking[begin:end] = False
    while m < end:
        if not cells[m]:
            m += 1
            continue
        p, q = turns[m, 0], turns[m, 1]
        over = clearance_at(field, x + p * a + q * u, y + p * b + q * v, z + p * c + q * w) - need[s, m]
        if over >= 0.0:
            m += 1 + int(min(over * stretch, float(end)))
            continue
        last = min(end, m + 1 + int(min(max(-over - field.cell, 0.0) * stretch, float(end))))
        for k in range(m, last):
            lacking[k] = cells[k]
        found, m = True, last
    return found


@njit(cache=True)
def _mark(
    field: Field,
    T: NDArray,
    local: NDArray,
    these: Circles,
    s: int,
    turns: NDArray,
    step: float,
    tell: bool,
    work: Work,
    row: NDArray,
    begin: int,
    end: int,
) -> None:
    """Marks the cells of a row from `begin` to `end`, those that are near, in which one ball lacks clearance or collides."""
    x, y, z = image(T, local, s, 0, 1.0)
    a, b, c = image(T, local, s, 3, 0.0)
    u, v, w = image(T, local, s, 6, 0.0)
    m, stretch, radius, bit = begin, stretch_of(these.distance[s], step), these.radius[s], bit_of(s)
    while m < end:
        if not work.near[m] or row[m] == SOLID or (row[m] == LACKING and not tell):
            m += 1
            continue
        p, q = turns[m, 0], turns[m, 1]
        clearance = clearance_at(field, x + p * a + q * u, y + p * b + q * v, z + p * c + q * w)
        over = clearance - work.need[s, m]
        if over >= 0.0:
            m += 1 + int(min(over * stretch, float(end)))
            continue
        last = min(end, m + 1 + int(min(max(-over - field.cell, 0.0) * stretch, float(end))))
        for k in range(m, last):
            work.lacking[k] |= bit
            if row[k] == DOUBT:
                row[k] = LACKING
        if not tell:
            m = last
        elif clearance >= radius:
            m += 1
        else:
            last = min(end, m + 1 + int(min(max(radius - clearance - field.cell, 0.0) * stretch, float(end))))
            for k in range(m, last):
                row[k] = SOLID
            m = last
