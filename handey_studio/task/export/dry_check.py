"""The dry check before anything is written for a controller: position, speed, acceleration, gaps, and that steps join."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.task.export.program import Program, ProgramStep
from handey_studio.world import Robot

JOIN_RAD, JOIN_M = 1e-6, 1e-6
GAP_S = 0.02  # between samples of a moving arm: what happens between them is the controller's guess
SHARE_OVER = 1.01  # differences of samples may pass a limit by this: the samples are rounded when they are written


def check_program(program: Program, robot: Robot) -> None:
    """Raises BadInput with the first thing that the robot cannot do: which joint or step, the value, the limit."""
    if program.joint_names != robot.joint_names:
        raise BadInput(
            f'the plan is for the joints {", ".join(program.joint_names)}, robot "{robot.name}" has {", ".join(robot.joint_names)}.'
        )
    for number, step in enumerate(program.steps, start=1):
        where = f"step {number} ({step.kind})"
        _check_reach(where, step, robot)
        _check_hand(where, step, robot)
        if step.moves_arm:
            _check_rates(where, step, robot)
    for number, (step, after) in enumerate(zip(program.steps, program.steps[1:], strict=False), start=1):
        _check_join(number, step, after, program.joint_names)


def _check_reach(where: str, step: ProgramStep, robot: Robot) -> None:
    over = np.maximum(step.q_rad - robot.upper, robot.lower - step.q_rad)
    if over.max() > JOIN_RAD:
        at, joint = np.unravel_index(int(over.argmax()), over.shape)
        limits = f"{np.rad2deg(robot.lower[joint]):.1f} to {np.rad2deg(robot.upper[joint]):.1f}°"
        raise BadInput(f"{where} takes {robot.joint_names[joint]} to {np.rad2deg(step.q_rad[at, joint]):.1f}°, its limits are {limits}.")


def _check_hand(where: str, step: ProgramStep, robot: Robot) -> None:
    low, high, hand = float(step.opening_m.min()), float(step.opening_m.max()), robot.hand
    if low < hand.opening_min - JOIN_M or high > hand.opening_max + JOIN_M:
        limits = f"{1e3 * hand.opening_min:.1f} to {1e3 * hand.opening_max:.1f} mm"
        raise BadInput(f"{where} opens the hand by {1e3 * low:.1f} to {1e3 * high:.1f} mm, its limits are {limits}.")
    if step.moves_arm and step.moves_hand:
        raise BadInput(f"{where} moves the joints and the fingers at once; controllers are given one after the other.")


def _check_rates(where: str, step: ProgramStep, robot: Robot) -> None:
    """Differences of the samples: what a controller that goes from one to the next does, from rest and to rest."""
    gaps = np.diff(step.time_s)
    if gaps.max() > GAP_S:
        at = step.time_s[int(gaps.argmax())]
        raise BadInput(f"{where} has a gap of {1e3 * gaps.max():.0f} ms between samples at {at:.2f} s, the limit is {1e3 * GAP_S:.0f} ms.")
    speed = np.diff(step.q_rad, axis=0) / gaps[:, None]
    _compare(f"{where} turns", speed, robot.velocity, robot.joint_names, "°/s")
    padded = np.concatenate([np.zeros((1, speed.shape[1])), speed, np.zeros((1, speed.shape[1]))])
    between = np.concatenate([gaps[:1], 0.5 * (gaps[1:] + gaps[:-1]), gaps[-1:]])
    _compare(f"{where} accelerates", np.diff(padded, axis=0) / between[:, None], robot.acceleration, robot.joint_names, "°/s²")


def _compare(what: str, values: NDArray, limits: NDArray, names: tuple[str, ...], unit: str) -> None:
    shares = np.abs(values) / limits
    if shares.max() > SHARE_OVER:
        at, joint = np.unravel_index(int(shares.argmax()), shares.shape)
        value, limit = np.rad2deg(abs(values[at, joint])), np.rad2deg(limits[joint])
        raise BadInput(f"{what} {names[joint]} by {value:.1f} {unit}, its limit is {limit:.1f} {unit}.")


def _check_join(number: int, step: ProgramStep, after: ProgramStep, names: tuple[str, ...]) -> None:
    jump = np.abs(after.q_rad[0] - step.q_rad[-1])
    if jump.max() > JOIN_RAD:
        joint = int(jump.argmax())
        raise BadInput(f"{names[joint]} jumps by {np.rad2deg(jump[joint]):.3f}° from step {number} ({step.kind}) to step {number + 1}.")
    opening = abs(float(after.opening_m[0] - step.opening_m[-1]))
    if opening > JOIN_M:
        raise BadInput(f"the hand jumps by {1e3 * opening:.2f} mm from step {number} ({step.kind}) to step {number + 1}.")
