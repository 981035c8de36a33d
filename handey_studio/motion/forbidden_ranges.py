"""The forbidden ranges of one joint for given values of the joints before it (Handey 1987 §4, Fig. 5), compiled.

Cells of half the width are looked at only in what wider ones leave in doubt: those of a solid one are none of them free.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base.compiled import put
from handey_studio.motion.circles import Circles, needs, place
from handey_studio.motion.cores import share
from handey_studio.motion.distance_field import Field
from handey_studio.motion.marching import DOUBT, FREE, LACKING, SOLID, march, refine, room

EVERY_BALL = 2**32 - 1


class Hinges(NamedTuple):
    """Where the arm joints' hinges are: `T_world_first` (4, 4), each other in the frame of the link that the arm joint before it turns,
    `T_first_second`, `T_second_third`; their `axes` (3, 3), each in its own frame.
    """

    T_world_first: NDArray
    T_first_second: NDArray
    T_second_third: NDArray
    axes: NDArray


class Cells(NamedTuple):
    """What the cells of joints 2, 1 and 3, in this order, are: `states` (n2, n1, n3). And which balls lack clearance in those of the
    widest cells that are in doubt: `lacking` (w2, w1, w3 + 1) uint32, a bit for each, all of them where nothing is known. The widest ones
    have been `halved` so often.
    """

    states: NDArray
    lacking: NDArray
    halved: int


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
def _axis(T: NDArray, axis: NDArray, out: NDArray) -> None:
    """A line (6,): the origin of T and an axis of its frame, in the frame that T maps to."""
    for i in range(3):
        out[i] = T[i, 3]
        out[3 + i] = T[i, 0] * axis[0] + T[i, 1] * axis[1] + T[i, 2] * axis[2]


@njit(cache=True)
def second_ranges(
    field: Field, hinges: Hinges, these: Circles, values: NDArray, turns: NDArray, step: float, tell: bool, first: NDArray, cells: NDArray
) -> None:
    """Settles the cells (n1, n2) of the second joint, for each value of the first, in which its link may meet the scene; those in doubt.

    Those of a value that is not free in `first` (n1,) are all as that is.
    """
    n2, k, groups = len(turns), len(these.radius), len(these.first) - 1
    local, before, work = np.empty((k, 9)), np.empty((1, 6)), room(k, groups, n2)
    place(hinges.T_first_second, these, local)
    _axis(np.eye(4), hinges.axes[0], before[0])
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
    wider: Cells | None,
    known: NDArray | None,
) -> Cells:
    """The cells of the third joint, for each value of the first two, as what it carries leaves them.

    All of a row are at least as it is in `rows` (n1, n2), each as it is `known` to be (n2, n1, n3). Only those are looked at which are in
    doubt in `wider`, the cells of twice their width, and which what is known does not settle; the others stay as they are there. Without
    `wider` all are in doubt, and solid ones are told. Each value of the second joint is a task of its own; the cores share them.
    """
    shape = (len(values[1]), len(values[0]), len(turns))
    known, states = np.empty((0, 0, 0), np.int8) if known is None else known, np.empty(shape, np.int8)
    if wider is None:
        wider = Cells(np.empty((0, 0, 0), np.int8), np.full((*shape[:2], shape[2] + 1), EVERY_BALL, np.uint32), -1)
    share(lambda mine: _third_ranges(field, hinges, these, values, turns, step, rows, wider, known, states, mine), len(values[1]))
    return Cells(states, wider.lacking, wider.halved + 1)


@njit(cache=True, nogil=True)
def _third_ranges(
    field: Field,
    hinges: Hinges,
    these: Circles,
    values: tuple[NDArray, NDArray],
    turns: NDArray,
    step: float,
    rows: NDArray,
    wider: Cells,
    known: NDArray,
    states: NDArray,
    mine: NDArray,
) -> None:
    """The same for some values of the second joint, those with numbers `mine`."""
    n1, n3, k = len(values[0]), len(turns), len(these.radius)
    halved, tell = wider.halved + 1, wider.halved < 0
    groups = len(these.first) - 1
    local, worlds, before, work = np.empty((k, 9)), np.empty((n1, 4, 4)), np.empty((2, 6)), room(k, groups, n3)
    for i in range(n1):
        T = turned(hinges.T_world_first, hinges.axes[0], values[0][i])
        for axis in range(4):
            put(T[axis], worlds[i, axis])
    _axis(hinges.T_first_second, hinges.axes[1], before[0])
    _axis(np.eye(4), hinges.axes[0], before[1])
    free = np.full(n3, FREE, np.int8)
    for j in mine:
        ready, blank = False, True
        for i in range(n1):
            row, a, b = states[j, i], i >> halved, j >> halved
            least = known[j, i] if len(known) else free
            if rows[i, j] == FREE and _ask(wider.states, least, i, j, tell, row):
                if not ready:
                    T = product(turned(hinges.T_first_second, hinges.axes[1], float(values[1][j])), hinges.T_second_third)
                    place(T, these, local)
                    ready = True
                if not tell and b < wider.lacking.shape[0] and a < wider.lacking.shape[1] and wider.lacking[b, a, 0] != EVERY_BALL:
                    refine(field, worlds[i], local, these, turns, before, step, wider.lacking[b, a], halved, row)
                else:
                    if blank:
                        needs(local, these, k - groups - 1, k, turns, before, step / 2, work.need)
                        work.known[:], blank = False, False
                    march(field, worlds[i], local, these, turns, before, step, tell, work, row)
                    if tell:
                        put(work.lacking, wider.lacking[j, i, :n3])
            _close(row, rows[i, j], least)


@njit(cache=True)
def _ask(wider: NDArray, known: NDArray, i: int, j: int, tell: bool, row: NDArray) -> bool:
    """Writes a row (n,) as the cells of twice its width have it, LACKING where what is in doubt need not be looked at; whether any need."""
    n, a, b = len(row), i // 2, j // 2
    row[:] = DOUBT
    if b < wider.shape[0] and a < wider.shape[1]:
        twice = wider[b, a]
        for m in range(min(len(twice), n // 2)):
            row[2 * m] = twice[m]
            row[2 * m + 1] = twice[m]
    enough, asked = SOLID if tell else DOUBT, 0
    for m in range(n):
        asks = row[m] == DOUBT and known[m] < enough
        row[m] = LACKING if row[m] == DOUBT and not asks else row[m]
        asked += asks
    return asked > 0


@njit(cache=True)
def _close(row: NDArray, before: int, least: NDArray) -> None:
    """What was looked at no further stays in doubt; no cell is freer than its row `before`, nor than `least` (n,) has it."""
    for m in range(len(row)):
        here = before if before != FREE else DOUBT if row[m] == LACKING else row[m]
        row[m] = max(here, least[m])
