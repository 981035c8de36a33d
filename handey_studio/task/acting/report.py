"""What happened in a MOVE, as the JSON that other programs read: fields of `handey/move/1`."""

from dataclasses import asdict, fields
from typing import Any

import numpy as np

from handey_studio.base import finite
from handey_studio.cell.recording import Event, Recording, Tracking
from handey_studio.task.acting.performance import Check, Incident, Performed, Recovery
from handey_studio.task.plan import MoveResult


def performance_report(result: MoveResult, recordings: bool) -> dict[str, Any]:
    """`attempts`, `incidents`, `recovery`, `tracking`, `check`, and with `recordings` what was measured, motion by motion."""
    performances = result.performances
    report: dict[str, Any] = {
        "attempts": len(performances),
        "incidents": [_incident(one, k + 1) for k, performance in enumerate(performances) for one in performance.incidents],
        "recovery": [_recovery(attempt.recovery, k + 1) for k, attempt in enumerate(result.attempts)],
        "tracking": _tracking(result.performance.tracking) if result.performance else None,
        "check": _check(result.check) if result.check else None,
        "execution_s": sum(performance.seconds for performance in performances),
    }
    if recordings:
        report["recordings"] = [_motion(one, k + 1) for k, performance in enumerate(performances) for one in performance.performed]
    return report


def _incident(incident: Incident, attempt: int) -> dict[str, Any]:
    numbers = {key: finite(getattr(incident, key)) for key in ("value", "limit")}
    return {"attempt": attempt} | asdict(incident) | numbers


def _recovery(recovery: Recovery, attempt: int) -> dict[str, Any]:
    """What was decided after an attempt."""
    ruled_out, felt = recovery.ruled_out, recovery.felt
    return {
        "attempt": attempt,
        "incident": str(recovery.incident),
        "actions": list(recovery.actions),
        "why": recovery.why,
        "ruled_out": {"kind": ruled_out.kind, "why": ruled_out.why} if ruled_out else None,
        "felt": {"name": felt.name, "size_m": _plain(felt.size), "T_world_block": _plain(felt.T_world_block)} if felt else None,
    }


def _check(check: Check) -> dict[str, Any]:
    return {
        "found": check.found,
        "sentence": check.sentence,
        "T_world_part": None if check.T_world_part is None else _plain(check.T_world_part),
        "off_m": check.off_m,
        "off_rad": check.off_rad,
        "rivals": list(check.rivals),
    }


def _tracking(tracking: Tracking) -> dict[str, float]:
    return {"joint_rad": tracking.joint_rad, "hand_m": 1e-3 * tracking.hand_mm}


def _motion(performed: Performed, attempt: int) -> dict[str, Any]:
    """One motion: planned against actual, forces and width over time."""
    return {
        "attempt": attempt,
        "step": performed.step,
        "what": performed.what,
        "start_s": performed.start_s,
        "ended": performed.ended,
        "tracking": _tracking(performed.tracking),
        **_columns(performed.recording),
        "events": [_event(event) for event in performed.recording.events],
    }


def _columns(recording: Recording) -> dict[str, Any]:
    return {field.name: _plain(getattr(recording, field.name)) for field in fields(Recording) if field.name != "events"}


def _event(event: Event) -> dict[str, Any]:
    return {"time_s": event.time_s, "what": event.what, "force_N": event.force_N}


def _plain(values: np.ndarray) -> Any:
    return np.asarray(values).tolist()
