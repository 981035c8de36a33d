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
def settled(screws: Screws, T_wanted: NDArray, q_start: NDArray, free: NDArray, rounds: int) -> tuple[bool, NDArray]:
    """Whether the free joints (f,) come from q_start (n,) to where the flange is at T_wanted, and the configuration."""
    q = q_start.copy()
    T = flange(screws, q)
    off = error(T, T_wanted)
    size = (off * off).sum()
    for _ in range(rounds):
        if size < 1e-26:
            break
        J = jacobian(screws, q, (T[0, 3], T[1, 3], T[2, 3]))[:, free]
        A = J.T @ J
        for k in range(len(free)):
            A[k, k] += size / 2.0 + LEAST_DAMPING
        trial = q.copy()
        trial[free] += np.linalg.solve(A, J.T @ off)
        T_trial = flange(screws, trial)
        off_trial = error(T_trial, T_wanted)
        size_trial = (off_trial * off_trial).sum()
        if size_trial >= size and size < EXACT * EXACT:
            break
        q, T, off, size = trial, T_trial, off_trial, size_trial
    return np.sqrt(size) < EXACT, q


@njit(cache=True)
def from_starts(screws: Screws, T_wanted: NDArray, starts: NDArray, free: NDArray, rounds: int) -> NDArray:
    """Where those of the starts (m, n) that settle do so (k, n), several times the same."""
    out, count = np.empty_like(starts), 0
    for k in range(len(starts)):
        done, q = settled(screws, T_wanted, starts[k], free, rounds)
        if done:
            out[count] = q
            count += 1
    return out[:count]
