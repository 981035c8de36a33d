"""The forbidden ranges of one joint for given values of the joints before it (Handey 1987 §4, Fig. 5), compiled.

Cells of half the width are looked at only in what wider ones leave in doubt: those of a solid one are none of them free.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.motion.cores import share
from handey_studio.motion.distance_field import Field
from handey_studio.motion.marching import DOUBT, FREE, LACKING, SOLID, Circles, march, needs, place, room


class Hinges(NamedTuple):
    """Where the arm joints' hinges are: `T_world_first` (4, 4), each other in the frame of the link that the arm joint before it turns,
    `T_first_second`, `T_second_third`; their `axes` (3, 3), each in its own frame.
    """

    T_world_first: NDArray
    T_first_second: NDArray
    T_second_third: NDArray
    axes: NDArray


@njit(cache=True)
def turned(T: NDArray, axis: NDArray, angle: float) -> NDArray:
    """T (4, 4) followed by a turn about an axis (3,) through its origin."""
    x, y, z = axis
    s, c = np.sin(angle), np.cos(angle)
    v = 1.0 - c
    R = np.array(
        [
            [c + x * x * v, x * y * v - z * s, x * z * v + y * s],
            [y * x * v + z * s, c + y * y * v, y * z * v - x * s],
            [z * x * v - y * s, z * y * v + x * s, c + z * z * v],
        ]
    )
    out = T.copy()
    for i in range(3):
        for j in range(3):
            out[i, j] = T[i, 0] * R[0, j] + T[i, 1] * R[1, j] + T[i, 2] * R[2, j]
    return out


@njit(cache=True)
def product(S: NDArray, T: NDArray) -> NDArray:
    """S @ T for two transforms (4, 4)."""
    out = np.zeros((4, 4))
    for i in range(4):
        for j in range(4):
            out[i, j] = S[i, 0] * T[0, j] + S[i, 1] * T[1, j] + S[i, 2] * T[2, j] + S[i, 3] * T[3, j]
    return out


@njit(cache=True)
def first_ranges(field: Field, hinges: Hinges, these: Circles, turns: NDArray, step: float, tell: bool, cells: NDArray) -> None:
    """Settles the cells (n1,) of the first joint in which its own link may meet the scene."""
    n, k, groups = len(turns), len(these.radius), len(these.first) - 1
    local, before, work = np.empty((k, 9)), np.empty((0, 6)), room(k, groups, n)
    place(np.eye(4), these, local)
    needs(local, these, k - groups - 1, k, turns, before, step / 2, work.need)
    march(field, hinges.T_world_first, local, these, turns, before, step, tell, work, cells)


@njit(cache=True)
def _axis(T: NDArray, axis: NDArray) -> NDArray:
    """A line: the origin of T and an axis of its frame, in the frame that T maps to."""
    out = np.empty(6)
    for i in range(3):
        out[i] = T[i, 3]
        out[3 + i] = T[i, 0] * axis[0] + T[i, 1] * axis[1] + T[i, 2] * axis[2]
    return out


@njit(cache=True)
def second_ranges(
    field: Field, hinges: Hinges, these: Circles, values: NDArray, turns: NDArray, step: float, tell: bool, first: NDArray, cells: NDArray
) -> None:
    """Settles the cells (n1, n2) of the second joint, for each value of the first, in which its link may meet the scene.

    Those of a value that is not free in `first` (n1,) are all as that is.
    """
    n2, k, groups = len(turns), len(these.radius), len(these.first) - 1
    local, before, work = np.empty((k, 9)), np.empty((1, 6)), room(k, groups, n2)
    place(hinges.T_first_second, these, local)
    before[0] = _axis(np.eye(4), hinges.axes[0])
    needs(local, these, k - groups - 1, k, turns, before, step / 2, work.need)
    for i in range(len(values)):
        if first[i] != FREE:
            cells[i] = first[i]
            continue
        T = turned(hinges.T_world_first, hinges.axes[0], values[i])
        march(field, T, local, these, turns, before, step, tell, work, cells[i])


def third_ranges(
    field: Field,
    hinges: Hinges,
    these: Circles,
    values: tuple[NDArray, NDArray],
    turns: NDArray,
    step: float,
    rows: NDArray,
    coarse: NDArray | None,
    known: NDArray | None,
    least: NDArray | None,
) -> NDArray:
    """The cells (n1, n2, n3) of the third joint, for each value of the first two, as what it carries leaves them.

    All of a row are at least as it is in `rows` (n1, n2), each as it is in `least`. Only those are looked at which are in doubt in
    `coarse`, the cells of twice their width, and of which nothing is `known` that settles them; the others stay as they are there. Without
    `coarse` all are in doubt, and solid ones are told. Each value of the second joint is a task of its own; the cores share them.
    """
    shape = (*rows.shape, len(turns))
    nothing, tell, cells = np.zeros(shape, np.int8), coarse is None, np.empty(shape, np.int8)
    wide = np.empty((0, 0, 0), np.int8) if coarse is None else coarse
    states = (wide, nothing if known is None else known, nothing if least is None else least)
    share(lambda mine: _third_ranges(field, hinges, these, values, turns, step, tell, rows, states, cells, mine), len(values[1]))
    return cells


@njit(cache=True, nogil=True)
def _third_ranges(
    field: Field,
    hinges: Hinges,
    these: Circles,
    values: tuple[NDArray, NDArray],
    turns: NDArray,
    step: float,
    tell: bool,
    rows: NDArray,
    states: tuple[NDArray, NDArray, NDArray],
    cells: NDArray,
    mine: NDArray,
) -> None:
    """The same for some values of the second joint, those with numbers `mine`."""
    n1, n3, k = len(values[0]), len(turns), len(these.radius)
    coarse, known, least = states
    groups = len(these.first) - 1
    local, worlds, before, work = np.empty((k, 9)), np.empty((n1, 4, 4)), np.empty((2, 6)), room(k, groups, n3)
    for i in range(n1):
        worlds[i] = turned(hinges.T_world_first, hinges.axes[0], values[0][i])
    before[0] = _axis(hinges.T_first_second, hinges.axes[1])
    before[1] = _axis(np.eye(4), hinges.axes[0])
    for j in mine:
        ready = False
        for i in range(n1):
            row = cells[i, j]
            if rows[i, j] == FREE and _ask(coarse, known, i, j, tell, row):
                if not ready:
                    T = product(turned(hinges.T_first_second, hinges.axes[1], float(values[1][j])), hinges.T_second_third)
                    place(T, these, local)
                    needs(local, these, k - groups - 1, k, turns, before, step / 2, work.need)
                    work.known[:], ready = False, True
                march(field, worlds[i], local, these, turns, before, step, tell, work, row)
            for m in range(n3):
                here = rows[i, j] if rows[i, j] != FREE else DOUBT if row[m] == LACKING else row[m]
                row[m] = max(here, least[i, j, m])


@njit(cache=True)
def _ask(coarse: NDArray, known: NDArray, i: int, j: int, tell: bool, row: NDArray) -> bool:
    """Writes a row (n,) as the cells of twice its width have it, LACKING where what is in doubt need not be looked at; whether any need."""
    n, a, b = len(row), i // 2, j // 2
    inside = min(2 * coarse.shape[2], n) if a < coarse.shape[0] and b < coarse.shape[1] else 0
    asked = False
    for m in range(n):
        row[m] = coarse[a, b, m // 2] if m < inside else DOUBT
        if row[m] == DOUBT:
            if known[i, j, m] == SOLID or (known[i, j, m] == DOUBT and not tell):
                row[m] = LACKING
            else:
                asked = True
    return asked
