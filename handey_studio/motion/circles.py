"""The circles that the balls of the arm run around while one joint turns and those before it stand still; compiled."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray


class Circles(NamedTuple):
    """Balls that a joint carries, in the frame of its hinge: at angle θ ball s is at `middle[s] + cos θ·across[s] + sin θ·along[s]`.

    `distance` (k,) [m] is a circle's radius, `radius` (k,) [m] the ball's with the margin, `slack` (k,) [m] what joints that are not the
    arm's may move it. After the balls come g = `len(first) - 1` big ones, number i of them around the
    balls `first[i]` to `first[i + 1] - 1`, and one around all, so that one look often answers for many.
    """

    middle: NDArray
    across: NDArray
    along: NDArray
    distance: NDArray
    radius: NDArray
    slack: NDArray
    first: NDArray


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
def need_at(circle: NDArray, start: float, c: float, d: float, before: NDArray, half: float) -> float:
    """The clearance [m] that a ball needs at the angle with cosine c and sine d; `start` without what moves it.

    `before` (b, 6) are the point and direction of the axes of the arm joints before, the nearest first, in the circles' frame. The joints
    move one by one, from the last to the first: a point at distance r of an axis, displaced by D already, is moved by `half`·(r + D) more.
    """
    x = circle[0] + c * circle[3] + d * circle[6]
    y = circle[1] + c * circle[4] + d * circle[7]
    z = circle[2] + c * circle[5] + d * circle[8]
    moved = start
    for b in range(len(before)):
        u, v, w = x - before[b, 0], y - before[b, 1], z - before[b, 2]
        along = u * before[b, 3] + v * before[b, 4] + w * before[b, 5]
        moved += half * (np.sqrt(max(u * u + v * v + w * w - along * along, 0.0)) + moved)
    return moved


@njit(cache=True)
def needs(local: NDArray, these: Circles, first: int, last: int, turns: NDArray, before: NDArray, half: float, out: NDArray) -> None:
    """Fills in the needs (k, n) [m] of the balls `first` to `last` - 1."""
    for s in range(first, last):
        start = half * these.distance[s] + these.slack[s]
        for m in range(len(turns)):
            out[s, m] = need_at(local[s], start, turns[m, 0], turns[m, 1], before, half) + these.radius[s]


@njit(cache=True)
def image(T: NDArray, circles: NDArray, s: int, part: int, shift: float) -> tuple[float, float, float]:
    """Middle (`part` 0, `shift` 1), across or along (3, 6; 0) of a circle in the frame that T maps to."""
    a, b, c = circles[s, part], circles[s, part + 1], circles[s, part + 2]
    return (
        T[0, 0] * a + T[0, 1] * b + T[0, 2] * c + shift * T[0, 3],
        T[1, 0] * a + T[1, 1] * b + T[1, 2] * c + shift * T[1, 3],
        T[2, 0] * a + T[2, 1] * b + T[2, 2] * c + shift * T[2, 3],
    )


@njit(cache=True)
def stretch_of(distance: float, step: float) -> float:
    """Cells for each metre of clearance: a need changes at most by 2·half + half² of how far the ball moves (see `need_at`)."""
    return 1.0 / ((distance + 1e-9) * step * (1.0 + step / 2.0) ** 2)
