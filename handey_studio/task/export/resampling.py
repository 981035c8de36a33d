"""Steps at a controller's own rate: whole ticks, on a smooth curve through the plan's samples, from rest to rest."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from handey_studio.base import BadInput
from handey_studio.task.export.program import Program, ProgramStep

LOWEST_HZ, HIGHEST_HZ = 10.0, 1000.0


def at_rate(program: Program, rate_hz: float, guarded_share: float = 1.0) -> Program:
    """The program in ticks of 1 / rate. A step takes up to a tick longer than planned, never shorter, so no limit is passed by it.

    Guarded descents (`place`) are run at a share of their speed. Steps of the fingers alone keep their two ends.
    """
    if not LOWEST_HZ <= rate_hz <= HIGHEST_HZ:
        raise BadInput(f"a rate of {rate_hz:g} Hz is not usable; it takes {LOWEST_HZ:g} to {HIGHEST_HZ:g} Hz.")
    if not 0.01 <= guarded_share <= 1.0:
        raise BadInput(f"guarded descents at {guarded_share:g} of their speed are not usable; it takes 0.01 to 1.")
    return replace(program, steps=tuple(_in_ticks(step, rate_hz, guarded_share) for step in program.steps))


def _in_ticks(step: ProgramStep, rate_hz: float, guarded_share: float) -> ProgramStep:
    if not step.moves_arm:
        return step
    seconds = float(step.time_s[-1])
    ticks = int(np.ceil(seconds / (guarded_share if step.kind == "place" else 1.0) * rate_hz - 1e-9))
    share = np.linspace(0.0, 1.0, ticks + 1)
    q, opening = motion_of(step)(share * seconds), np.interp(share * seconds, step.time_s, step.opening_m)
    q[0], q[-1] = step.q_rad[0], step.q_rad[-1]
    return ProgramStep(step.kind, np.arange(ticks + 1) / rate_hz, q, opening)


def motion_of(step: ProgramStep) -> CubicSpline:
    """The smooth motion through a step's samples, at rest at both ends; its derivatives are velocity and acceleration."""
    return CubicSpline(step.time_s, step.q_rad, bc_type="clamped")


def rates_of(step: ProgramStep) -> tuple[NDArray, NDArray]:
    """Velocities and accelerations (n, joints) [rad/s, rad/s²] at a step's samples; zero where the arm stands still."""
    if not step.moves_arm or len(step.time_s) < 2:
        return np.zeros_like(step.q_rad), np.zeros_like(step.q_rad)
    motion = motion_of(step)
    return motion(step.time_s, 1), motion(step.time_s, 2)
