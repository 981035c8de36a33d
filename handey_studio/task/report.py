"""Results as the JSON that other programs read (schema `handey/move/1`)."""

from typing import Any

import numpy as np

from handey_studio.base import entry_report, finite, rejected_counts
from handey_studio.grasping import BumpRun, Grip
from handey_studio.motion.answer import certificate_report
from handey_studio.task.acting.report import performance_report
from handey_studio.task.plan import Carry, GraspChoice, MoveResult, Step
from handey_studio.task.removal import STAGES as REMOVALS
from handey_studio.world import Robot

OPTIONS = {"destination", "grasp group", "grasp class", "approach group", "approach", "reach", "straight motion", *REMOVALS, "arm motion"}


def move_report(results: list[MoveResult], robot: Robot, recordings: bool = False) -> dict[str, Any]:
    """All MOVEs of one run; with `recordings` also what was measured while they were carried out."""
    moves = [_move(result, robot) | performance_report(result, recordings) for result in results]
    return {"schema": "handey/move/1", "robot": robot.name, "moves": moves}


def _move(result: MoveResult, robot: Robot) -> dict[str, Any]:
    plan = result.plan
    options = [entry for entry in result.ledger if entry.stage in OPTIONS]
    return {
        "part": plan.part if plan else result.command.part,
        "destination": result.command.to,
        "status": result.status,
        "reason": result.reason,
        "T_world_part_start": plain(result.T_world_part_start),
        "T_world_part_goal": plain(result.T_world_part_goal),
        "T_world_part_reached": plain(result.T_world_part_reached),
        "grasp": _grasp(plan.carries[0].grasp) if plan else None,
        "regrasps": plan.regrasps if plan else 0,
        "carries": [_carry(carry) for carry in plan.carries] if plan else [],
        "steps": [_step(step, robot) for step in plan.steps] if plan else [],
        "certificate": certificate_report(plan.certificate) if plan else None,
        "options": {"tried": len(options), "rejected": rejected_counts(options)},
        "ledger": [entry_report(entry) for entry in result.ledger],
        "physics": result.physics,
        "timing_s": result.timing_s,
    }


def _carry(carry: Carry) -> dict[str, Any]:
    return {
        "first_step": carry.first_step,
        "T_world_part_start": plain(carry.T_world_part_start),
        "T_world_part_goal": plain(carry.T_world_part_goal),
        "grasp": _grasp(carry.grasp),
        "lifting": _led(carry.lifting),
        "lowering": _led(carry.lowering),
    }


def _led(run: BumpRun | None) -> dict[str, Any] | None:
    """What led the part in hand; null where it went straight up, or straight down."""
    return None if run is None else {"found_by": run.found_by, "T_world_plane": plain(run.plane.T_world_plane), "path": plain(run.path)}


def _grasp(grasp: GraspChoice) -> dict[str, Any]:
    return {
        "class": grasp.name,
        "faces": list(grasp.faces),
        "group": grasp.group,
        "T_hand_part": plain(grasp.T_hand_part),
        "angle_rad": grasp.angle,
        "legal_ranges_rad": plain(grasp.ranges),
        "tilts_rad": list(grasp.tilts),
        "width_m": grasp.width,
        "opening_m": grasp.opening,
        "contact_area_m2": grasp.contact_area,
        "joint_margin_rad": grasp.joint_margin,
        "grip": _grip(grasp.grip) if grasp.grip else None,
    }


def _grip(grip: Grip) -> dict[str, Any]:
    """How much more than the part's weight the fingers would hold, at the worst turn of the carry, and what would happen first."""
    return {
        "force_margin_N": grip.force_margin,
        "torque_margin_Nm": grip.torque_margin,
        "needed_force_N": finite(grip.needed_force),
        "worst_down_hand": list(grip.worst),
        "limit": grip.limit,
    }


def _step(step: Step, robot: Robot) -> dict[str, Any]:
    """`held_joints` tells where the held joints of a redundant arm stand at the step's two ends."""
    return {
        "kind": step.kind,
        "joint_names": list(step.joint_names),
        "time_s": plain(step.time_s),
        "q_rad": plain(step.q_rad),
        "held_joints": {robot.joint_names[k]: plain(step.q_rad[[0, -1], k]) for k in robot.held_index},
        "hand_opening_m": plain(step.hand_opening_m),
        "clearance_m": plain(step.clearance_m),
        "held": step.held,
        "T_hand_part": plain(step.T_hand_part),
        "allowed_contacts": [list(pair) for pair in step.allowed_contacts],
    }


def plain(values: np.ndarray | None) -> Any:
    """An array as nested lists; None stays None."""
    return None if values is None else np.asarray(values).tolist()
