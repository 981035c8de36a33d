"""From a timed trajectory to what the controller follows at every step: places, velocities, accelerations."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from handey_studio.base import Value, frozen_array
from handey_studio.motion import Trajectory

LEAD_S = 0.1  # in which what the arm stood off the motion's start is taken back


@dataclass(frozen=True, eq=False)
class Course(Value):
    """A motion at the times of the controller's steps, the first at its start.

    `q`, `velocity`, `acceleration` (n, joints), `opening` and its `speed` (n,).
    """

    q: NDArray
    velocity: NDArray
    acceleration: NDArray
    opening: NDArray
    speed: NDArray

    def __post_init__(self) -> None:
        for key in ("q", "velocity", "acceleration", "opening", "speed"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))


def course(motion: Trajectory, q_start: NDArray, dt: float) -> Course:
    """The motion in steps of `dt` [s], smooth between its samples, led in from where the arm is commanded to stand."""
    keep = np.r_[True, np.diff(motion.time_s) > 1e-9]
    times, q, opening = motion.time_s[keep], motion.q_rad[keep], motion.hand_opening_m[keep]
    at = np.arange(max(1, int(np.ceil(times[-1] / dt))) + 1) * dt
    if len(times) == 1:
        places = np.repeat(q, len(at), axis=0), np.zeros((len(at), q.shape[1])), np.zeros((len(at), q.shape[1]))
    else:
        smooth = CubicHermiteSpline(times, q, np.gradient(q, times, axis=0, edge_order=2) if len(times) > 2 else np.zeros_like(q))
        places = tuple(np.where(at[:, None] > times[-1], end, smooth(at, k)) for k, end in enumerate((q[-1], 0.0, 0.0)))
    openings = np.interp(at, times, opening)
    lead = _lead(at) * (q_start - q[0])
    return Course(places[0] + lead, places[1], places[2], openings, np.gradient(openings, dt))


def _lead(at: NDArray) -> NDArray:
    """1 at the start, 0 after `LEAD_S`, level at both ends: (n, 1)."""
    share = np.clip(at / LEAD_S, 0.0, 1.0)[:, None]
    return 1.0 - share**2 * (3.0 - 2.0 * share)
