"""Carrying out a plan in a cell, step by step (Handey 1987 §2): grip, guarded placement, release."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Progress, Silent, Value, frozen_array
from handey_studio.cell.protocol import CannotAct, Cell, Moved
from handey_studio.motion import PathResult, Trajectory, straight_path, time_path
from handey_studio.task.plan import Carry, MovePlan, Step
from handey_studio.world import Held, Part, Robot, World, arm_of

GRIP_TOLERANCE_M = 0.0025  # the fingers' width on a part may differ from the model's by this much
EARLY_M = 0.004  # contact this far above the commanded pose is something else than the support
SEARCH_M = 0.001  # and this far below it the descent still looks for its support: no deeper than touching bodies may overlap
GUARDED_SPEED = 0.25


@dataclass(frozen=True, eq=False)
class Performance(Value):
    """How an execution ended: `done`, or the reason why not. `T_world_part_reached` (4, 4) by the arm's joints at release."""

    done: bool
    reason: str
    T_world_part_reached: NDArray | None = None


def execute(plan: MovePlan, carried: World, part: Part, cell: Cell, ledger: Ledger, progress: Progress = Silent()) -> Performance:
    """Do every step. `carried` is the world without the part, in which the guarded descent is continued."""
    reached = None
    for count, step in enumerate(plan.steps):
        if progress.cancelled:
            return Performance(False, "cancelled", reached)
        progress.report(count / len(plan.steps), f"step {count + 1} of {len(plan.steps)}: {step.kind}")
        carry = plan.carry_at(count)
        held = Held(plan.part, part, frozen_array(carry.grasp.T_hand_part))
        try:
            problem, reached = _do(step, carry, carried, held, cell, reached)
        except CannotAct as error:
            problem = str(error)
        entry = ledger.add("step", step.kind)
        if problem:
            ledger.fall(entry, problem)
            return Performance(False, problem, reached)
    return Performance(True, "", reached)


def _do(step: Step, carry: Carry, carried: World, held: Held, cell: Cell, reached: NDArray | None) -> tuple[str, NDArray | None]:
    """One step; (problem or "", the part's pose by the arm's joints once it was put down)."""
    if step.kind == "close":
        closed = cell.grip(carry.grasp.width - GRIP_TOLERANCE_M)
        width = closed.opening_m
        off = abs(width - carry.grasp.width)
        if not closed.contact or off > GRIP_TOLERANCE_M:
            what = "the fingers closed on nothing" if not closed.contact else "the fingers hold something of another width"
            return f"{what}: {1e3 * width:.1f} mm, expected {1e3 * carry.grasp.width:.1f} ± {1e3 * GRIP_TOLERANCE_M:.1f} mm", reached
        return "", reached
    if step.kind == "open":
        reached = arm_of(carried.robot).hand_pose(cell.joints()) @ held.T_hand_part
        cell.grip(float(step.hand_opening_m[-1]))
        return "", reached
    if step.kind == "place":
        return _place(step, carry, carried, held, cell), reached
    cell.follow(_from_here(step, cell.joints(), carried.robot))
    return "", reached


def _from_here(step: Step, q: NDArray, robot: Robot) -> Trajectory:
    """The step's motion, led in from where the guarded descent left the arm: it may have stopped a little off."""
    opening, lead = step.hand_opening_m, PathResult("found", "", np.array([q, step.q_rad[0]]))
    led = time_path(robot, lead, float(opening[0]))
    times = [led.time_s, led.time_s[-1] + step.time_s[1:]]
    return Trajectory(np.concatenate(times), np.concatenate([led.q_rad, step.q_rad[1:]]), np.concatenate([led.hand_opening_m, opening[1:]]))


def _place(step: Step, carry: Carry, carried: World, held: Held, cell: Cell) -> str:
    """Descend until contact; a problem in words if it came too early or not at all."""
    moved = cell.descend(Trajectory(step.time_s / GUARDED_SPEED, step.q_rad, step.hand_opening_m))
    height = _height_above_goal(moved, carry, carried, held)
    if moved.contact:
        return "" if height <= EARLY_M else f"contact {1e3 * height:.1f} mm above the destination, limit {1e3 * EARLY_M:.1f} mm"
    T_world_hand = arm_of(carried.robot).hand_pose(moved.q_rad)
    poses = np.repeat(T_world_hand[None], 4, axis=0)
    poses[:, 2, 3] -= np.linspace(0.0, SEARCH_M, len(poses))
    deeper = straight_path(carried, moved.q_rad, poses, carry.grasp.width, held, step.allowed_contacts)
    if deeper.found:
        timed = time_path(carried.robot, deeper, carry.grasp.width)
        moved = cell.descend(Trajectory(timed.time_s / GUARDED_SPEED, timed.q_rad, timed.hand_opening_m))
    return "" if moved.contact else f"no contact down to {1e3 * SEARCH_M:.1f} mm below the destination"


def _height_above_goal(moved: Moved, carry: Carry, carried: World, held: Held) -> float:
    T_world_part = arm_of(carried.robot).hand_pose(moved.q_rad) @ held.T_hand_part
    return float(T_world_part[2, 3] - carry.T_world_part_goal[2, 3])
