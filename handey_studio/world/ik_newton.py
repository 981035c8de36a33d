"""Inverse kinematics by iteration: polishing a near solution, and for arms of no known layout, from many starts.

Levenberg–Marquardt with the damping that Sugihara (2011) gives it, half the squared error: far off it descends, near it is Newton's method.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.world.screws import Screws, flange, jacobian
from handey_studio.world.vectors import cross, dot, length, plus, row, times

EXACT = 1e-10  # metres and radians together: as near as a solution is taken for one
LEAST_DAMPING = 1e-15
FAR_ROUNDS, NEAR_ROUNDS = 40, 12


@njit(cache=True)
def error(T: NDArray, T_wanted: NDArray) -> NDArray:
    """The way (6,) from one pose to another: metres, then the rotation vector [rad], both in the base's frame."""
    out = np.empty(6)
    columns, wanted = T.T, T_wanted.T
    vector, trace = (0.0, 0.0, 0.0), 0.0
    for k in range(3):
        a, b = row(columns, k), row(wanted, k)
        vector, trace = plus(vector, times(0.5, cross(a, b))), trace + dot(a, b)
    sine = length(vector)
    angle = np.arctan2(sine, (trace - 1.0) / 2.0)
    if sine > 1e-12:
        vector = times(angle / sine, vector)
    elif angle > 1.0:
        vector = (angle, 0.0, 0.0)  # half a turn: about any axis
    for k in range(3):
        out[k], out[3 + k] = T_wanted[k, 3] - T[k, 3], vector[k]
    return out


@njit(cache=True)
def _squared(off: NDArray) -> float:
    total = 0.0
    for k in range(len(off)):
        total += off[k] * off[k]
    return total


@njit(cache=True)
def _step(J: NDArray, off: NDArray, free: NDArray, damping: float) -> NDArray:
    """How far (f,) the free joints go: the solution of (JᵀJ + damping) step = Jᵀ off, by Cholesky's method in plain loops.

    The library's routines would take ten seconds to compile.
    """
    n = len(free)
    A, step = np.empty((n, n)), np.empty(n)
    for i in range(n):
        step[i] = 0.0
        for r in range(6):
            step[i] += J[r, free[i]] * off[r]
        for j in range(i + 1):
            A[i, j] = damping if i == j else 0.0
            for r in range(6):
                A[i, j] += J[r, free[i]] * J[r, free[j]]
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            A[i, j] = np.sqrt(max(A[i, j], LEAST_DAMPING)) if i == j else A[i, j] / A[j, j]
        for k in range(i):
            step[i] -= A[i, k] * step[k]
        step[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            step[i] -= A[k, i] * step[k]
        step[i] /= A[i, i]
    return step


@njit(cache=True)
def settled(screws: Screws, T_wanted: NDArray, q_start: NDArray, free: NDArray, rounds: int) -> tuple[bool, NDArray]:
    """Whether the free joints (f,) come from q_start (n,) to where the flange is at T_wanted, and the configuration."""
    q = q_start.copy()
    T = flange(screws, q)
    off = error(T, T_wanted)
    size = _squared(off)
    for _ in range(rounds):
        if size < 1e-26:
            break
        step = _step(jacobian(screws, q, (T[0, 3], T[1, 3], T[2, 3])), off, free, size / 2.0 + LEAST_DAMPING)
        trial = q.copy()
        for k in range(len(free)):
            trial[free[k]] += step[k]
        T_trial = flange(screws, trial)
        off_trial = error(T_trial, T_wanted)
        size_trial = _squared(off_trial)
        if size_trial >= size and size < EXACT * EXACT:
            break
        q, T, off, size = trial, T_trial, off_trial, size_trial
    return np.sqrt(size) < EXACT, q


@njit(cache=True)
def _settle_all(screws: Screws, T_wanted: NDArray, rows: NDArray, free: NDArray, rounds: int, done: NDArray) -> None:
    """Settles each row (m, n) where it stands, and tells in `done` (m,) which did."""
    for k in range(len(rows)):
        done[k], q = settled(screws, T_wanted, rows[k], free, rounds)
        for i in range(len(q)):
            rows[k, i] = q[i]


def from_starts(screws: Screws, T_wanted: NDArray, starts: NDArray, free: NDArray, rounds: int) -> NDArray:
    """Where those of the starts (m, n) that settle do so (k, n), several times the same."""
    rows, done = starts.copy(), np.zeros(len(starts), bool)
    _settle_all(screws, T_wanted, rows, free, rounds, done)
    return rows[done]
