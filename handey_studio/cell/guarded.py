"""Guarded motion: where along a path the hand, or what it holds, first presses on something."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.check.penetration import Polytope, overlap, polytope, polytopes_of
from handey_studio.geometry.transforms import apply
from handey_studio.motion import Trajectory
from handey_studio.world.arm import Arm, hand_hulls

STRIDE_M = 2.5e-4  # the hand moves no further between two looks
PRESS_M = 2e-4  # depth that counts as pressing; less is a graze along a side, which the hand's compliance takes
TOUCH_M = 1e-5  # depth at which the motion is said to have touched
BISECTIONS = 20

Placed = list[tuple[Polytope, NDArray]]  # a convex piece and its pose


def first_touch(arm: Arm, motion: Trajectory, others: Sequence[SolidBody], held: tuple[SolidBody, NDArray] | None) -> float | None:
    """Time [s] at which the hand or the held body (with its T_hand_body) first touches one of the others, None if never.

    A pair that overlaps at the start may stay as deep as it is; the arm's links are not looked at.
    """
    moving = _moving(arm, motion, held)
    standing = [(piece, body.T_world_body) for body in others for piece in polytopes_of(body)]
    centres_m, radii_m = _balls(moving)
    centres_s, radii_s = _balls(standing)

    def depths(time: float) -> NDArray:
        T = arm.hand_pose(motion_at(motion, time))
        gaps = np.linalg.norm(apply(T, centres_m)[:, None] - centres_s[None], axis=2) - radii_m[:, None] - radii_s[None]
        result = -gaps
        for m, s in zip(*np.nonzero(gaps < 0), strict=True):
            result[m, s] = overlap(moving[m][0], T @ moving[m][1], *standing[s])
        return result

    times = _looks(arm, motion)
    allowed = np.maximum(depths(times[0]), 0.0) + TOUCH_M
    apart = np.full(allowed.shape, times[0])
    for time in times[1:]:
        deeper = depths(time) - allowed
        pressed = deeper > PRESS_M
        if pressed.any():
            return _bisect(lambda t, pairs=pressed: bool((depths(t) > allowed)[pairs].any()), float(apart[pressed].min()), float(time))
        apart[deeper <= 0] = time
    return None


def motion_at(motion: Trajectory, time: float) -> NDArray:
    """The configuration (joints,) [rad] at a time [s]."""
    return np.array([np.interp(time, motion.time_s, column) for column in motion.q_rad.T])


def _bisect(touches, before: float, after: float) -> float:
    for _ in range(BISECTIONS):
        middle = (before + after) / 2
        before, after = (before, middle) if touches(middle) else (middle, after)
    return after


def _moving(arm: Arm, motion: Trajectory, held: tuple[SolidBody, NDArray] | None) -> Placed:
    """The hand's boxes and the held body's pieces, with their poses in the hand frame."""
    opening = float(motion.hand_opening_m[0])
    moving: Placed = [(polytope(corners), np.eye(4)) for corners in hand_hulls(arm.robot, opening).values()]
    if held is not None:
        moving += [(piece, held[1]) for piece in polytopes_of(held[0])]
    return moving


def _balls(placed: Placed) -> tuple[NDArray, NDArray]:
    """Centres (k, 3) and radii (k,) [m] of balls around placed pieces."""
    middles = [piece.corners.mean(axis=0) for piece, _ in placed]
    radii = [np.linalg.norm(piece.corners - middle, axis=1).max() for (piece, _), middle in zip(placed, middles, strict=True)]
    return np.array([apply(T, middle) for (_, T), middle in zip(placed, middles, strict=True)]), np.array(radii)


def _looks(arm: Arm, motion: Trajectory) -> NDArray:
    """Times [s] so dense that the hand's origin moves less than STRIDE_M between them."""
    origins = arm.hand_pose(motion.q_rad)[:, :3, 3]
    steps = np.maximum(1, np.ceil(np.linalg.norm(np.diff(origins, axis=0), axis=1) / STRIDE_M)).astype(int)
    spans = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(motion.time_s[:-1], motion.time_s[1:], steps, strict=True)]
    return np.concatenate([*spans, motion.time_s[-1:]])
