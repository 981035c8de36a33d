"""Inverse kinematics in closed form. Each solver takes T_base_flange (4, 4) and returns every branch (k, n) [rad].

Source of the UR solution: K. Hawkins, "Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms", 2013. The
Denavit–Hartenberg lengths are read from the loaded model, so that one solver serves the whole family.
"""

from collections.abc import Callable
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import inverse

if TYPE_CHECKING:
    from handey_studio.world.arm import Arm

Solver = Callable[[NDArray], NDArray]
REACH_SLACK = 1e-9  # a cosine may leave [-1, 1] by this much from rounding and still count as a stretched arm


def ur_solver(arm: "Arm") -> Solver:
    """IK of a Universal Robots arm: up to eight branches."""
    T = arm.T_links
    d1, a2, a3 = T[0, 2, 3], -T[2, 2, 3], -T[3, 2, 3]
    d4 = T[1, 1, 3] + T[2, 1, 3] + T[4, 1, 3]
    d5, d6 = T[5, 2, 3], arm.T_last_flange[1, 3]
    # The model's base frame is turned half a turn about z against the Denavit–Hartenberg one.
    turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    last = _calibrate_flange(arm, d1, a2, a3, d4, d5, d6, turn)

    def solve(T_base_flange: NDArray) -> NDArray:
        return _ur_branches(turn @ T_base_flange @ last, d1, a2, a3, d4, d5, d6)

    return solve


def _calibrate_flange(arm: "Arm", d1: float, a2: float, a3: float, d4: float, d5: float, d6: float, turn: NDArray) -> NDArray:
    """The fixed T_flange_dh6 of this model; BadInput when the arm is not of the UR family."""
    fixed = []
    for q in (np.zeros(6), np.array([0.3, -1.1, 0.9, 0.4, -0.7, 1.3])):
        T_base_flange = inverse(arm.robot.T_world_base) @ arm.link_poses(q)[-1] @ arm.T_last_flange
        fixed.append(inverse(turn @ T_base_flange) @ _ur_forward(q, d1, a2, a3, d4, d5, d6))
    if np.abs(fixed[0] - fixed[1]).max() > 1e-6:
        raise BadInput(f'robot "{arm.robot.name}": ik = "ur" needs the joint layout of a Universal Robots arm.')
    return fixed[0]


def _dh(theta: float, d: float, a: float, alpha: float) -> NDArray:
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array([[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0, sa, ca, d], [0, 0, 0, 1]])


def _ur_forward(q: NDArray, d1: float, a2: float, a3: float, d4: float, d5: float, d6: float) -> NDArray:
    rows = ((d1, 0, np.pi / 2), (0, a2, 0), (0, a3, 0), (d4, 0, np.pi / 2), (d5, 0, -np.pi / 2), (d6, 0, 0))
    T = np.eye(4)
    for theta, (d, a, alpha) in zip(q, rows, strict=True):
        T = T @ _dh(theta, d, a, alpha)
    return T


def _ur_branches(T06: NDArray, d1: float, a2: float, a3: float, d4: float, d5: float, d6: float) -> NDArray:
    """All solutions (k, 6) of the standard Denavit–Hartenberg arm."""
    p05 = T06[:3, 3] - d6 * T06[:3, 2]
    radius = np.hypot(p05[0], p05[1])
    if radius < abs(d4) * (1 - REACH_SLACK):
        return np.empty((0, 6))
    solutions = []
    for shoulder, wrist, elbow in product((1, -1), repeat=3):
        q1 = np.arctan2(p05[1], p05[0]) + shoulder * np.arccos(min(1.0, d4 / radius)) + np.pi / 2
        s1, c1 = np.sin(q1), np.cos(q1)
        cos5 = (T06[0, 3] * s1 - T06[1, 3] * c1 - d4) / d6
        if abs(cos5) > 1 + REACH_SLACK:
            continue
        q5 = wrist * np.arccos(np.clip(cos5, -1, 1))
        s5 = np.sin(q5)
        # At the wrist's singularity joints 4 and 6 turn about parallel axes; any share between them is right.
        y6, x6 = -T06[0, 1] * s1 + T06[1, 1] * c1, T06[0, 0] * s1 - T06[1, 0] * c1
        q6 = 0.0 if abs(s5) < 1e-8 else np.arctan2(y6 / s5, x6 / s5)
        T14 = inverse(_dh(q1, d1, 0, np.pi / 2)) @ T06 @ inverse(_dh(q5, d5, 0, -np.pi / 2) @ _dh(q6, d6, 0, 0))
        x, y = T14[:2, 3]
        cos3 = (x * x + y * y - a2 * a2 - a3 * a3) / (2 * a2 * a3)
        if abs(cos3) > 1 + REACH_SLACK:
            continue
        q3 = elbow * np.arccos(np.clip(cos3, -1, 1))
        q2 = np.arctan2(y, x) - np.arctan2(a3 * np.sin(q3), a2 + a3 * np.cos(q3))
        q4 = np.arctan2(T14[1, 0], T14[0, 0]) - q2 - q3
        solutions.append([q1, q2, q3, q4, q5, q6])
    wrapped = np.array(solutions).reshape(-1, 6)
    return np.pi - np.mod(np.pi - wrapped, 2 * np.pi)


IK_SOLVERS: dict[str, Callable[["Arm"], Solver]] = {"ur": ur_solver}
