"""Vectors of three numbers as tuples, which compiled code keeps in registers: much faster than arrays of length three."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Vector = tuple[float, float, float]


@njit(cache=True)
def row(rows: NDArray, k: int) -> Vector:
    """Row k of an array (n, 3)."""
    return rows[k, 0], rows[k, 1], rows[k, 2]


@njit(cache=True)
def plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit(cache=True)
def minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True)
def times(size: float, a: Vector) -> Vector:
    return size * a[0], size * a[1], size * a[2]


@njit(cache=True)
def dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def length(a: Vector) -> float:
    return np.sqrt(dot(a, a))


@njit(cache=True)
def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def across(axis: Vector, a: Vector) -> Vector:
    """The part of a vector that is square to an axis of length one."""
    return minus(a, times(dot(axis, a), axis))


@njit(cache=True)
def rotated(axis: Vector, cosine: float, sine: float, a: Vector) -> Vector:
    """A vector turned about an axis of length one by the angle of that cosine and sine (Rodrigues)."""
    return plus(plus(times(cosine, a), times(sine, cross(axis, a))), times(dot(axis, a) * (1.0 - cosine), axis))


@njit(cache=True)
def turned(axis: Vector, angle: float, a: Vector) -> Vector:
    """A vector turned about an axis of length one by an angle [rad]."""
    return rotated(axis, np.cos(angle), np.sin(angle), a)


@njit(cache=True)
def placed_by(T: NDArray, point: Vector) -> Vector:
    """A point taken through a transform (4, 4)."""
    return plus(turned_by(T, point), (T[0, 3], T[1, 3], T[2, 3]))


@njit(cache=True)
def turned_by(T: NDArray, v: Vector) -> Vector:
    """A direction taken through a transform (4, 4)."""
    return dot(row(T, 0), v), dot(row(T, 1), v), dot(row(T, 2), v)


@njit(cache=True)
def turned_back_by(T: NDArray, v: Vector) -> Vector:
    """A direction taken back through a transform (4, 4)."""
    return plus(plus(times(v[0], row(T, 0)), times(v[1], row(T, 1))), times(v[2], row(T, 2)))
