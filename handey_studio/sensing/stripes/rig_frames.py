"""The range frame on a board that lies on the table, and the step that the rig makes between two photographs of it."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, logm

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import apply, inverse, rotation_angle, transform
from handey_studio.sensing.stripes.board import Board

LEAST_STEP_M = 1e-6
PURE_SHIFT_RAD = np.deg2rad(0.5)  # a rig that turns by less between two photographs only shifts


def range_frame(T_camera_board: NDArray, board: Board) -> NDArray:
    """T_range_camera for the range frame on a board: origin in its middle, z out of it, x as near to the photograph's rows as can be.

    The board's own corners could be counted from either end, so its axes are not used.
    """
    origin = apply(T_camera_board, board.corners.mean(axis=0))
    up = T_camera_board[:3, 2] * (-1.0 if T_camera_board[:3, 2] @ origin > 0 else 1.0)
    x = np.array([1.0, 0.0, 0.0]) - up[0] * up
    x /= np.linalg.norm(x)
    return inverse(transform(np.stack([x, np.cross(up, x), up], axis=1), origin))


def one_step(before: NDArray, after: NDArray, board: Board, T_range_camera: NDArray, steps: int, step_m: float | None) -> NDArray:
    """The rig's step (4, 4) from a resting board's poses before the camera, before and after some steps.

    `step_m` is a step's length [m] where that is known better: the poses then give its direction only.
    """
    T_before_after = before @ inverse(after)
    if rotation_angle(T_before_after[:3, :3]) < PURE_SHIFT_RAD:
        middle = board.corners.mean(axis=0)
        shift = apply(before, middle) - apply(after, middle)
        length = np.linalg.norm(shift) / steps
        if not length > LEAST_STEP_M:
            raise BadInput(f"the board moved by {1e3 * length * steps:.3f} mm only before the camera, so the rig's step is not known.")
        return transform(None, T_range_camera[:3, :3] @ shift / steps * (1.0 if step_m is None else step_m / length))
    T_range = T_range_camera @ T_before_after @ inverse(T_range_camera)
    step = np.real(expm(np.asarray(logm(T_range)) / steps))
    u, _, vh = np.linalg.svd(step[:3, :3])
    return transform(u @ vh, step[:3, 3])
