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
def _normal(W: NDArray, i: int, j: int, k: int) -> tuple[float, float, float]:
    """The normal of triangle ijk, twice its area long."""
    ax, ay, az = W[j, 0] - W[i, 0], W[j, 1] - W[i, 1], W[j, 2] - W[i, 2]
    bx, by, bz = W[k, 0] - W[i, 0], W[k, 1] - W[i, 1], W[k, 2] - W[i, 2]
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@njit(cache=True)
def _on_segment(W: NDArray, i: int, j: int, v: NDArray) -> int:
    """Writes the point of segment ij nearest the origin into v; which corners carry it, as bits."""
    x, y, z = W[j, 0] - W[i, 0], W[j, 1] - W[i, 1], W[j, 2] - W[i, 2]
    length, t = x * x + y * y + z * z, -(W[i, 0] * x + W[i, 1] * y + W[i, 2] * z)
    mask = (1 << i) | (1 << j)
    if t <= 0.0 or length == 0.0:
        t, mask = 0.0, 1 << i
    elif t >= length:
        t, mask = 1.0, 1 << j
    else:
        t /= length
    v[0], v[1], v[2] = W[i, 0] + t * x, W[i, 1] + t * y, W[i, 2] + t * z
    return mask


@njit(cache=True)
def _beyond(W: NDArray, i: int, j: int, nx: float, ny: float, nz: float) -> bool:
    """Whether the origin lies outside the wall on side ij of a triangle with normal n."""
    x, y, z = W[j, 0] - W[i, 0], W[j, 1] - W[i, 1], W[j, 2] - W[i, 2]
    return (ny * z - nz * y) * W[i, 0] + (nz * x - nx * z) * W[i, 1] + (nx * y - ny * x) * W[i, 2] > 0.0


@njit(cache=True)
def _keep_nearer(mask: int, v: NDArray, side: int, other: NDArray) -> int:
    """The nearer of two points to the origin, in v, and the corners that carry it."""
    if _dot(other, other) < _dot(v, v):
        v[0], v[1], v[2] = other[0], other[1], other[2]
        return side
    return mask


@njit(cache=True)
def _on_triangle(W: NDArray, i: int, j: int, k: int, v: NDArray, spare: NDArray) -> int:
    """The same for triangle ijk: inside its three walls its plane's foot, else the best of its sides."""
    nx, ny, nz = _normal(W, i, j, k)
    nn = nx * nx + ny * ny + nz * nz
    if nn > 0.0 and not (_beyond(W, i, j, nx, ny, nz) or _beyond(W, j, k, nx, ny, nz) or _beyond(W, k, i, nx, ny, nz)):
        share = (W[i, 0] * nx + W[i, 1] * ny + W[i, 2] * nz) / nn
        v[0], v[1], v[2] = nx * share, ny * share, nz * share
        return (1 << i) | (1 << j) | (1 << k)
    mask = _on_segment(W, i, j, v)
    mask = _keep_nearer(mask, v, _on_segment(W, j, k, spare), spare)
    return _keep_nearer(mask, v, _on_segment(W, k, i, spare), spare)


@njit(cache=True)
def _on_tetrahedron(W: NDArray, v: NDArray, spare: NDArray, other: NDArray) -> int:
    """The same for all four corners; 15 when the origin is inside."""
    mask = 15
    v[0] = 1e150
    for apex in range(4):
        i, j, k = (1 if apex == 0 else 0), (2 if apex < 2 else 1), (3 if apex < 3 else 2)
        nx, ny, nz = _normal(W, i, j, k)
        origin = -(nx * W[i, 0] + ny * W[i, 1] + nz * W[i, 2])
        across = nx * (W[apex, 0] - W[i, 0]) + ny * (W[apex, 1] - W[i, 1]) + nz * (W[apex, 2] - W[i, 2])
        if origin * across <= 0.0:
            mask = _keep_nearer(mask, v, _on_triangle(W, i, j, k, other, spare), other)
    return mask


@njit(cache=True)
def _nearest(W: NDArray, n: int, v: NDArray, spare: NDArray, other: NDArray) -> int:
    """Nearest point of the simplex of n corners to the origin, into v; the corners that carry it move to the front, their count returns."""
    mask = 1
    if n == 1:
        v[0], v[1], v[2] = W[0, 0], W[0, 1], W[0, 2]
    elif n == 2:
        mask = _on_segment(W, 0, 1, v)
    elif n == 3:
        mask = _on_triangle(W, 0, 1, 2, v, spare)
    else:
        mask = _on_tetrahedron(W, v, spare, other)
    kept = 0
    for i in range(n):
        if mask & (1 << i):
            W[kept, 0], W[kept, 1], W[kept, 2] = W[i, 0], W[i, 1], W[i, 2]
            kept += 1
    return kept


@njit(cache=True)
def distance(A: NDArray, a0: int, a1: int, B: NDArray, b0: int, b1: int, limit: float) -> float:
    """Lower bound [m] of the distance between the hulls of A[a0:a1] and B[b0:b1], exact within 1e-8 of itself; 0 when they meet.

    Ends early with some value ≥ `limit` as soon as that much is certain.
    """
    W, v, spare, other = np.empty((4, 3)), np.empty(3), np.empty(3), np.empty(3)
    v[0], v[1], v[2] = A[a0, 0] - B[b0, 0], A[a0, 1] - B[b0, 1], A[a0, 2] - B[b0, 2]
    bound, n = 0.0, 0
    for _ in range(MAX_ITERATIONS):
        vv = _dot(v, v)
        if vv < TOUCHING_SQUARED:
            return 0.0
        a, b = _farthest(A, a0, a1, -v[0], -v[1], -v[2]), _farthest(B, b0, b1, v[0], v[1], v[2])
        x, y, z = A[a, 0] - B[b, 0], A[a, 1] - B[b, 1], A[a, 2] - B[b, 2]
        vw = v[0] * x + v[1] * y + v[2] * z
        bound = max(bound, vw / np.sqrt(vv))
        if bound >= limit or vv - vw <= CONVERGED * vv:
            return bound
        for i in range(n):
            if W[i, 0] == x and W[i, 1] == y and W[i, 2] == z:
                return bound
        W[n, 0], W[n, 1], W[n, 2] = x, y, z
        n = _nearest(W, n + 1, v, spare, other)
        if n == 4:
            return 0.0
    return bound
