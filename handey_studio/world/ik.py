"""Inverse kinematics: every branch, by the solver that suits an arm's layout.

A solver is built for an arm once. It takes T_base_flange (4, 4) and the values of the held joints (h,) [rad], and returns every branch
(k, n) [rad], limits aside. What closed forms find is polished where they lose digits, beside singularities.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import inverse
from handey_studio.world.ik_closed import spherical_wrist, three_parallel
from handey_studio.world.ik_newton import FAR_ROUNDS, NEAR_ROUNDS, from_starts
from handey_studio.world.ik_seven import held_third
from handey_studio.world.screws import Screws
from handey_studio.world.vectors import Vector

if TYPE_CHECKING:
    from handey_studio.world.arm import Arm

Solver = Callable[[NDArray, NDArray], NDArray]

SAME_M, SAME_RAD = 1e-6, 1e-6  # axes this near meet, this near in direction are parallel
SAME_BRANCH_RAD = 1e-5  # configurations this near are one branch, found twice
STARTS = 600
SIX = np.arange(6)


def ur(arm: "Arm") -> Solver:
    """Axes 2, 3 and 4 parallel, 5 and 6 meeting: up to eight branches."""
    screws = _six(arm, "ur")
    _parallel(arm, screws, "ur", (2, 3, 4))
    meet, back = _meeting(arm, screws, "ur", (5, 6)), inverse(screws.T_zero)
    return lambda T, held: _polished(screws, T, *three_parallel(screws, T @ back, meet))


def wrist(arm: "Arm") -> Solver:
    """Axes 2 and 3 parallel, 4, 5 and 6 meeting: up to eight branches."""
    screws = _six(arm, "spherical_wrist")
    _parallel(arm, screws, "spherical_wrist", (2, 3))
    meet, back = _meeting(arm, screws, "spherical_wrist", (4, 5, 6)), inverse(screws.T_zero)
    return lambda T, held: _polished(screws, T, *spherical_wrist(screws, T @ back, meet))


def _polished(screws: Screws, T: NDArray, rows: NDArray, count: int) -> NDArray:
    return from_starts(screws, T, rows[:count], SIX, NEAR_ROUNDS)


def seven(arm: "Arm") -> Solver:
    """Seven joints of which the third is held; axes 1, 2 and 3 meet, 5 and 6 meet."""
    screws = arm.screws
    if arm.n != 7 or list(arm.robot.held_index) != [2]:
        raise _unfit(arm, "seven", f"needs 7 joints of which the third is held, it has {arm.n} and holds {list(arm.robot.held_joints)}")
    shoulder, meet = _meeting(arm, screws, "seven", (1, 2, 3)), _meeting(arm, screws, "seven", (5, 6))
    back = inverse(screws.T_zero)
    return lambda T, held: held_third(screws, T, T @ back, shoulder, meet, float(held[0]), NEAR_ROUNDS)


def numeric(arm: "Arm") -> Solver:
    """Any layout of six free joints: from many starts, the same ones each time. Slower, and a branch in a hundred may be missed."""
    robot, screws = arm.robot, arm.screws
    free = np.setdiff1d(np.arange(arm.n), robot.held_index)
    if len(free) != 6:
        raise _unfit(arm, "numeric", f"needs 6 free joints, it has {len(free)}; name all but six in held_joints")
    half = np.minimum((robot.upper - robot.lower) / 2, np.pi)
    middle = (robot.upper + robot.lower) / 2
    starts = np.random.default_rng(0).uniform(middle - half, middle + half, (STARTS, arm.n))

    def solve(T: NDArray, held: NDArray) -> NDArray:
        starts[:, robot.held_index] = held
        return from_starts(screws, T, starts, free, FAR_ROUNDS)

    return solve


IK_SOLVERS: dict[str, Callable[["Arm"], Solver]] = {"ur": ur, "spherical_wrist": wrist, "seven": seven, "numeric": numeric}


def branches(solver: Solver, T_base_flange: NDArray, held_values: NDArray, held_index: NDArray) -> NDArray:
    """Every branch (k, n) for each row of the held values (m, h) in turn, each once, angles in (-π, π], the held ones as given."""
    found = []
    for held in held_values:
        q = distinct(solver(np.ascontiguousarray(T_base_flange), held))
        q[:, held_index] = held
        found.append(q)
    return np.concatenate(found)


def distinct(rows: NDArray) -> NDArray:
    """Configurations (k, n) with angles in (-π, π], those that differ from all before them."""
    wrapped = np.pi - np.mod(np.pi - rows, 2 * np.pi)
    kept = np.ones(len(rows), bool)
    _mark_repeated(wrapped, kept)
    return wrapped[kept]


@njit(cache=True)
def _mark_repeated(rows: NDArray, kept: NDArray) -> None:
    """Clears `kept` (k,) for configurations (k, n) that are about the same as one kept before them."""
    for k in range(len(rows)):
        for before in range(k):
            gap = 0.0
            for i in range(rows.shape[1]):
                turn = abs(rows[k, i] - rows[before, i])
                gap = max(gap, min(turn, 2.0 * np.pi - turn))
            if kept[before] and gap <= SAME_BRANCH_RAD:
                kept[k] = False
                break


def _six(arm: "Arm", name: str) -> Screws:
    if arm.n != 6:
        raise _unfit(arm, name, f"needs 6 joints, it has {arm.n}")
    return arm.screws


def _parallel(arm: "Arm", screws: Screws, name: str, numbers: tuple[int, ...]) -> None:
    for a, b in pairwise(numbers):
        slope = float(np.linalg.norm(np.cross(screws.directions[a - 1], screws.directions[b - 1])))
        if slope > SAME_RAD:
            raise _unfit(arm, name, f"needs axes {a} and {b} parallel, they are {np.rad2deg(np.arcsin(min(slope, 1.0))):.3g}° apart")


def _meeting(arm: "Arm", screws: Screws, name: str, numbers: tuple[int, ...]) -> Vector:
    """The point [m] in which axes meet at zero, numbered from 1."""
    index = np.array(numbers) - 1
    along, points = screws.directions[index], screws.points[index]
    square = np.eye(3) - along[:, :, None] * along[:, None, :]
    meet = np.linalg.lstsq(square.sum(axis=0), (square @ points[:, :, None]).sum(axis=0)[:, 0], rcond=None)[0]
    gap = float(np.linalg.norm((square @ (meet - points)[:, :, None])[:, :, 0], axis=1).max())
    if gap > SAME_M:
        listed = " and ".join(str(number) for number in numbers)
        raise _unfit(arm, name, f"needs axes {listed} to meet in a point, they pass it by {1e3 * gap:.3g} mm")
    return float(meet[0]), float(meet[1]), float(meet[2])


def _unfit(arm: "Arm", name: str, why: str) -> BadInput:
    return BadInput(f'robot "{arm.robot.name}": ik = "{name}" {why}; ik = "numeric" takes any layout.')
