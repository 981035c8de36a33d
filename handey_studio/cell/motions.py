"""What every cell refuses before anything moves."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.protocol import CannotAct
from handey_studio.motion import Trajectory
from handey_studio.world.robot import Hand, Robot

START_RAD = 0.01  # a motion must start this close to where the arm stands


def check_motion(motion: Trajectory, robot: Robot, q: NDArray) -> None:
    """Raises `CannotAct` for a motion that the robot, standing at `q` (joints,) [rad], cannot begin or may not do."""
    angles, times = motion.q_rad, motion.time_s
    if angles.ndim != 2 or angles.shape[1] != len(q) or not len(angles) == len(times) == len(motion.hand_opening_m) > 0:
        raise CannotAct(f"the motion has angles {angles.shape} for {len(times)} times; this arm takes {len(q)} angles at each.")
    if not (np.isfinite(angles).all() and np.isfinite(motion.hand_opening_m).all() and (np.diff(times) >= 0).all()):
        raise CannotAct("the motion holds a number that is not finite, or times that run backwards.")
    off = float(np.abs(angles[0] - q).max())
    if off > START_RAD:
        raise CannotAct(f"the motion starts {off:.3f} rad from where the arm stands; the limit is {START_RAD} rad.")
    if robot.limit_margin(angles).min() < -1e-9:
        raise CannotAct("the motion leaves the joint limits.")


def check_opening(hand: Hand, opening: float) -> None:
    """Raises `CannotAct` for an opening [m] that the hand does not have."""
    if not hand.opening_min <= opening <= hand.opening_max:
        raise CannotAct(f"the hand opens from {hand.opening_min} to {hand.opening_max} m, so it cannot go to {opening:.4f} m.")
