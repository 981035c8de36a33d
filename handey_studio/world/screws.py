"""The arm as screws: its joint axes in the base's frame, where they are with every joint at zero.

The flange is at T = e₁(q₁) … eₙ(qₙ) T₀, where eᵢ turns about axis i where it is at zero (product of exponentials, Brockett 1984).
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.world.vectors import Vector, cross, minus, plus, row, turned


class Screws(NamedTuple):
    """The joints' axes at zero, as `directions` (n, 3) through `points` (n, 3) [m], and T_base_flange (4, 4) there, `T_zero`."""

    points: NDArray
    directions: NDArray
    T_zero: NDArray


@njit(cache=True)
def screwed(screws: Screws, joint: int, angle: float, point: Vector) -> Vector:
    """A point turned about a joint's axis at zero."""
    on = row(screws.points, joint)
    return plus(on, turned(row(screws.directions, joint), angle, minus(point, on)))


@njit(cache=True)
def swung(screws: Screws, joint: int, angle: float, v: Vector) -> Vector:
    """A direction turned about a joint's axis at zero."""
    return turned(row(screws.directions, joint), angle, v)


@njit(cache=True)
def flange(screws: Screws, q: NDArray) -> NDArray:
    """T_base_flange (4, 4) at q (n,) [rad]."""
    T = screws.T_zero.copy()
    for joint in range(len(q) - 1, -1, -1):
        for column in range(3):
            T[0, column], T[1, column], T[2, column] = swung(screws, joint, q[joint], (T[0, column], T[1, column], T[2, column]))
        T[0, 3], T[1, 3], T[2, 3] = screwed(screws, joint, q[joint], (T[0, 3], T[1, 3], T[2, 3]))
    return T


@njit(cache=True)
def jacobian(screws: Screws, q: NDArray, tip: Vector) -> NDArray:
    """How fast (6, n) the flange, whose origin is at `tip`, moves: metres, then radians, for each radian of each joint at q."""
    n = len(q)
    out = np.empty((6, n))
    for joint in range(n):
        point, axis = row(screws.points, joint), row(screws.directions, joint)
        for before in range(joint - 1, -1, -1):
            point, axis = screwed(screws, before, q[before], point), swung(screws, before, q[before], axis)
        out[0, joint], out[1, joint], out[2, joint] = cross(axis, minus(tip, point))
        out[3, joint], out[4, joint], out[5, joint] = axis
    return out
