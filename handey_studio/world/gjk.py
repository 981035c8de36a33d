"""Distance between two convex bodies given by their corners: Gilbert, Johnson & Keerthi 1988, compiled.

What is returned is the support function's lower bound, not the length of the last iterate: should the iteration stall, the
answer is too small, never too large. A certificate may lean on it.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

MAX_ITERATIONS = 64
TOUCHING_SQUARED = 1e-18  # a nanometre: nearer bodies touch
CONVERGED = 1e-8  # relative gap between the lower bound and the iterate's length


@njit(cache=True)
def _farthest(points: NDArray, first: int, last: int, x: float, y: float, z: float) -> int:
    best, found = -1e300, first
    for i in range(first, last):
        value = points[i, 0] * x + points[i, 1] * y + points[i, 2] * z
        if value > best:
            best, found = value, i
    return found


@njit(cache=True)
def _dot(a: NDArray, b: NDArray) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _on_segment(W: NDArray, i: int, j: int, v: NDArray) -> int:
    """Writes the point of segment ij nearest the origin into v; which corners carry it, as bits."""
    along = W[j] - W[i]
    length, t = _dot(along, along), -_dot(W[i], along)
    if t <= 0.0 or length == 0.0:
        v[:] = W[i]
        return 1 << i
    if t >= length:
        v[:] = W[j]
        return 1 << j
    v[:] = W[i] + along * (t / length)
    return (1 << i) | (1 << j)


@njit(cache=True)
def _on_triangle(W: NDArray, i: int, j: int, k: int, v: NDArray) -> int:
    """The same for triangle ijk: inside its three walls its plane's foot, else the best of its sides."""
    ab, ac = W[j] - W[i], W[k] - W[i]
    n = np.cross(ab, ac)
    nn = _dot(n, n)
    if nn > 1e-30 * _dot(ab, ab) * _dot(ac, ac):
        inside_ab = _dot(np.cross(n, ab), W[i]) <= 0.0
        inside_bc = _dot(np.cross(n, W[k] - W[j]), W[j]) <= 0.0
        inside_ca = _dot(np.cross(n, -ac), W[k]) <= 0.0
        if inside_ab and inside_bc and inside_ca:
            v[:] = n * (_dot(W[i], n) / nn)
            return (1 << i) | (1 << j) | (1 << k)
    mask = _on_segment(W, i, j, v)
    other = np.empty(3)
    for a, b in ((j, k), (k, i)):
        side = _on_segment(W, a, b, other)
        if _dot(other, other) < _dot(v, v):
            mask = side
            v[:] = other
    return mask


@njit(cache=True)
def _on_tetrahedron(W: NDArray, v: NDArray) -> int:
    """The same for all four corners; 15 when the origin is inside."""
    mask, least = 15, 1e300
    other = np.empty(3)
    for i, j, k, apex in ((0, 1, 2, 3), (0, 1, 3, 2), (0, 2, 3, 1), (1, 2, 3, 0)):
        n = np.cross(W[j] - W[i], W[k] - W[i])
        if -_dot(n, W[i]) * _dot(n, W[apex] - W[i]) > 0.0:
            continue
        side = _on_triangle(W, i, j, k, other)
        if _dot(other, other) < least:
            mask, least = side, _dot(other, other)
            v[:] = other
    return mask


@njit(cache=True)
def _nearest(W: NDArray, n: int, v: NDArray) -> int:
    """Nearest point of the simplex of n corners to the origin, into v; the corners that carry it move to the front, their count returns."""
    if n == 1:
        v[:] = W[0]
        return 1
    if n == 2:
        mask = _on_segment(W, 0, 1, v)
    elif n == 3:
        mask = _on_triangle(W, 0, 1, 2, v)
    else:
        mask = _on_tetrahedron(W, v)
    kept = 0
    for i in range(n):
        if mask & (1 << i):
            W[kept] = W[i]
            kept += 1
    return kept


@njit(cache=True)
def distance(A: NDArray, a0: int, a1: int, B: NDArray, b0: int, b1: int, limit: float) -> float:
    """Lower bound [m] of the distance between the hulls of A[a0:a1] and B[b0:b1], exact within 1e-8 of itself; 0 when they meet.

    Ends early with some value ≥ `limit` as soon as that much is certain.
    """
    W, v, bound, n = np.empty((4, 3)), A[a0] - B[b0], 0.0, 0
    for _ in range(MAX_ITERATIONS):
        vv = _dot(v, v)
        if vv < TOUCHING_SQUARED:
            return 0.0
        w = A[_farthest(A, a0, a1, -v[0], -v[1], -v[2])] - B[_farthest(B, b0, b1, v[0], v[1], v[2])]
        vw = _dot(v, w)
        bound = max(bound, vw / np.sqrt(vv))
        if bound >= limit or vv - vw <= CONVERGED * vv:
            return bound
        for i in range(n):
            if W[i, 0] == w[0] and W[i, 1] == w[1] and W[i, 2] == w[2]:
                return bound
        W[n] = w
        n = _nearest(W, n + 1, v)
        if n == 4:
            return 0.0
    return bound
