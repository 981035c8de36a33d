"""The forbidden ranges of one joint for given values of the joints before it (Handey 1987 §4, Fig. 5), compiled.

While one joint turns and those before it stand still, a sphere of the arm runs around a circle. At a cell's centre it needs as much
clearance as half a cell of each joint can move it. What it has beyond that lasts for some cells more, and so does what it lacks: the
ranges are found in strides, and their cost grows with the surface of what is forbidden, not with the cells in it.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.motion.cores import share
from handey_studio.motion.distance_field import Field, clearance_at


class Circles(NamedTuple):
    """Balls that a joint carries, in the frame of its hinge: at angle θ ball s is at `middle[s] + cos θ·across[s] + sin θ·along[s]`.

    `distance` (k,) [m] is a circle's radius, `radius` (k,) [m] the ball's with the margin, `slack` (k,) [m] what joints that are not the
    arm's may move it. The last g = `len(first) - 1` balls are big ones: number i of them is around the
    balls `first[i]` to `first[i + 1] - 1`, so that one look often answers for all of these.
    """

    middle: NDArray
    across: NDArray
    along: NDArray
    distance: NDArray
    radius: NDArray
    slack: NDArray
    first: NDArray


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
def place(T: NDArray, these: Circles, out: NDArray) -> None:
    """Middle, across and along, out (k, 9), of circles in the frame that T maps to."""
    for s in range(len(out)):
        for axis in range(3):
            a, b, c = T[axis, 0], T[axis, 1], T[axis, 2]
            out[s, axis] = a * these.middle[s, 0] + b * these.middle[s, 1] + c * these.middle[s, 2] + T[axis, 3]
            out[s, 3 + axis] = a * these.across[s, 0] + b * these.across[s, 1] + c * these.across[s, 2]
            out[s, 6 + axis] = a * these.along[s, 0] + b * these.along[s, 1] + c * these.along[s, 2]


@njit(cache=True)
def turn_circles(T: NDArray, circles: NDArray, out: NDArray) -> None:
    """Placed circles (k, 9) in the frame that T maps to."""
    for s in range(len(out)):
        for axis in range(3):
            a, b, c = T[axis, 0], T[axis, 1], T[axis, 2]
            out[s, axis] = a * circles[s, 0] + b * circles[s, 1] + c * circles[s, 2] + T[axis, 3]
            out[s, 3 + axis] = a * circles[s, 3] + b * circles[s, 4] + c * circles[s, 5]
            out[s, 6 + axis] = a * circles[s, 6] + b * circles[s, 7] + c * circles[s, 8]


@njit(cache=True)
def need_of(circle: NDArray, start: float, turns: NDArray, before: NDArray, half: float, out: NDArray) -> None:
    """The clearance (n,) [m] that a ball needs at each of n angles with `turns` (n, 2) cosine and sine; `start` without what moves it.

    `before` (b, 6) are the point and direction of the axes of the arm joints before, the nearest first, in the circles' frame. The joints
    move one by one, from the last to the first: a point at distance r of an axis, displaced by D already, is moved by `half`·(r + D) more.
    """
    for m in range(len(turns)):
        c, d = turns[m]
        x = circle[0] + c * circle[3] + d * circle[6]
        y = circle[1] + c * circle[4] + d * circle[7]
        z = circle[2] + c * circle[5] + d * circle[8]
        moved = start
        for b in range(len(before)):
            u, v, w = x - before[b, 0], y - before[b, 1], z - before[b, 2]
            along = u * before[b, 3] + v * before[b, 4] + w * before[b, 5]
            moved += half * (np.sqrt(max(u * u + v * v + w * w - along * along, 0.0)) + moved)
        out[m] = moved


@njit(cache=True)
def needs(local: NDArray, these: Circles, first: int, last: int, turns: NDArray, before: NDArray, half: float, out: NDArray) -> None:
    """Fills in the needs (k, n) [m] of the balls `first` to `last` - 1."""
    for s in range(first, last):
        need_of(local[s], half * these.distance[s] + these.slack[s], turns, before, half, out[s])
        out[s] += these.radius[s]


@njit(cache=True)
def march(
    field: Field,
    T: NDArray,
    local: NDArray,
    these: Circles,
    turns: NDArray,
    before: NDArray,
    step: float,
    need: NDArray,
    known: NDArray,
    doubt: NDArray,
    blocked: NDArray,
) -> None:
    """Marks those cells of a row (n,) that are forbidden of those in `doubt` (n,).

    Its circles are `local` (k, 9) in a frame that T (4, 4) maps to the world.

    Each group's big ball goes first; the small ones look only at cells where it lacks clearance. `need` (k, n) [m] is filled in for the
    small ones of a group when first asked for, and `known` (groups,) tells which.
    """
    groups = len(these.first) - 1
    small = len(local) - groups
    near, free = np.empty(len(turns), np.bool_), np.empty(len(turns), np.bool_)
    circle = np.empty((1, 9))
    for group in range(groups):
        begin, end, big = these.first[group], these.first[group + 1], small + group
        near[:] = False
        free[:] = doubt & ~blocked
        turn_circles(T, local[big : big + 1], circle)
        if not _march_ball(field, circle[0], these.distance[big], turns, need[big], step, free, near):
            continue
        if not known[group]:
            needs(local, these, begin, end, turns, before, step / 2, need)
            known[group] = True
        for s in range(begin, end):
            turn_circles(T, local[s : s + 1], circle)
            _march_ball(field, circle[0], these.distance[s], turns, need[s], step, near, blocked)


@njit(cache=True)
def _march_ball(
    field: Field, circle: NDArray, distance: float, turns: NDArray, need: NDArray, step: float, cells: NDArray, lacking: NDArray
) -> bool:
    """Marks as `lacking` (n,) those of the cells (n,) that are not yet, in which one ball lacks clearance; whether any does.

    A need changes at most by 2·half + half² of how far the ball moves (see `need_of`): a stride is shorter by that factor.
    """
    n, m, found = len(turns), 0, False
    stretch = 1.0 / ((distance + 1e-9) * step * (1.0 + step / 2.0) ** 2)
    while m < n:
        if lacking[m] or not cells[m]:
            m += 1
            continue
        c, d = turns[m]
        over = -need[m] + clearance_at(
            field,
            circle[0] + c * circle[3] + d * circle[6],
            circle[1] + c * circle[4] + d * circle[7],
            circle[2] + c * circle[5] + d * circle[8],
        )
        if over >= 0.0:
            m += 1 + int(min(over * stretch, float(n)))
            continue
        end = min(n, m + 1 + int(min(max(-over - field.cell, 0.0) * stretch, float(n))))
        lacking[m:end] = True
        found, m = True, end
    return found


@njit(cache=True)
def first_ranges(field: Field, hinges: Hinges, these: Circles, turns: NDArray, step: float) -> NDArray:
    """Cells (n1,) of the first joint in which its own link meets the scene."""
    n, k, groups = len(turns), len(these.radius), len(these.first) - 1
    local, need, blocked = np.empty((k, 9)), np.empty((k, n)), np.zeros(n, np.bool_)
    place(np.eye(4), these, local)
    before = np.empty((0, 6))
    needs(local, these, k - groups, k, turns, before, step / 2, need)
    march(field, hinges.T_world_first, local, these, turns, before, step, need, np.zeros(groups, np.bool_), np.ones(n, np.bool_), blocked)
    return blocked


@njit(cache=True)
def _axis(T: NDArray, axis: NDArray) -> NDArray:
    """A line: the origin of T and an axis of its frame, in the frame that T maps to."""
    out = np.empty(6)
    for i in range(3):
        out[i] = T[i, 3]
        out[3 + i] = T[i, 0] * axis[0] + T[i, 1] * axis[1] + T[i, 2] * axis[2]
    return out


@njit(cache=True)
def second_ranges(field: Field, hinges: Hinges, these: Circles, values: NDArray, turns: NDArray, step: float, known: NDArray) -> NDArray:
    """Cells (n1, n2) of the second joint, for each value of the first (n1,), in which its link meets the scene; all where `known` (n1,)."""
    n1, n2, k = len(values), len(turns), len(these.radius)
    local, need, groups = np.empty((k, 9)), np.empty((k, n2)), len(these.first) - 1
    blocked = np.zeros((n1, n2), np.bool_)
    place(hinges.T_first_second, these, local)
    before = np.empty((1, 6))
    before[0] = _axis(np.eye(4), hinges.axes[0])
    needs(local, these, k - groups, k, turns, before, step / 2, need)
    told, doubt = np.zeros(groups, np.bool_), np.ones(n2, np.bool_)
    for i in range(n1):
        if known[i]:
            blocked[i] = True
            continue
        T = turned(hinges.T_world_first, hinges.axes[0], values[i])
        march(field, T, local, these, turns, before, step, need, told, doubt, blocked[i])
    return blocked


def third_ranges(
    field: Field,
    hinges: Hinges,
    these: Circles,
    values: tuple[NDArray, NDArray],
    turns: NDArray,
    step: float,
    known: NDArray,
    doubt: NDArray,
    blocked: NDArray,
) -> None:
    """Marks the cells (n1, n2, n3) of the third joint, for each value of the first two, in which what it carries meets the scene.

    Rows that are `known` (n1, n2) to be forbidden, and cells that are in no `doubt` (n1, n2, n3), are left alone. Each value of the second
    joint is a task of its own; the processor's cores share them.
    """
    share(lambda mine: _third_ranges(field, hinges, these, values, turns, step, known, doubt, blocked, mine), len(values[1]))


@njit(cache=True, nogil=True)
def _third_ranges(
    field: Field,
    hinges: Hinges,
    these: Circles,
    values: tuple[NDArray, NDArray],
    turns: NDArray,
    step: float,
    known: NDArray,
    doubt: NDArray,
    blocked: NDArray,
    mine: NDArray,
) -> None:
    """The same for some values of the second joint, those with numbers `mine`."""
    n1, n3, k = len(values[0]), len(turns), len(these.radius)
    local, need, groups = np.empty((k, 9)), np.empty((k, n3)), len(these.first) - 1
    worlds, before, told = np.empty((n1, 4, 4)), np.empty((2, 6)), np.empty(groups, np.bool_)
    for i in range(n1):
        worlds[i] = turned(hinges.T_world_first, hinges.axes[0], values[0][i])
    before[0] = _axis(hinges.T_first_second, hinges.axes[1])
    before[1] = _axis(np.eye(4), hinges.axes[0])
    for j in mine:
        if known[:, j].all():
            continue
        T = product(turned(hinges.T_first_second, hinges.axes[1], float(values[1][j])), hinges.T_second_third)
        place(T, these, local)
        needs(local, these, k - groups, k, turns, before, step / 2, need)
        told[:] = False
        for i in range(n1):
            if not known[i, j]:
                march(field, worlds[i], local, these, turns, before, step, need, told, doubt[i, j], blocked[i, j])
