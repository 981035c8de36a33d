"""A calibration as JSON (schema `handey/calibration/1`) and as lines for a person."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import entry_report, finite
from handey_studio.geometry.transforms import apply, pose_difference, to_xyz_rpy
from handey_studio.sensing.frame_fit import FrameFit
from handey_studio.task.calibrating.calibrate import RangeCalibration


def calibration_report(found: RangeCalibration) -> dict[str, Any]:
    """Every pose with its residual, both fits, the paper's answer, what was tried."""
    return {
        "schema": "handey/calibration/1",
        "status": found.status,
        "reason": found.reason,
        "T_world_range_before": found.T_world_range_before.tolist(),
        "T_world_range": None if found.fit is None else found.fit.T_world_range.tolist(),
        "T_world_range_three_poses": None if found.three is None else found.three.tolist(),
        "fit": _fit(found.fit),
        "free_fit": _fit(found.free),
        "poses": _poses(found),
        "ledger": [entry_report(entry) for entry in found.ledger],
    }


def _fit(fit: FrameFit | None) -> dict[str, Any] | None:
    if fit is None:
        return None
    return {
        "T_world_range": fit.T_world_range.tolist(),
        "face_hand_m": fit.face_hand.tolist(),
        "rms_m": fit.rms_m,
        "sigma_m": [finite(value) for value in fit.sigma_m.tolist()],
        "sigma_rad": [finite(value) for value in fit.sigma_rad.tolist()],
        "tilt_rad": fit.tilt_rad,
        "warnings": list(fit.warnings),
    }


def _poses(found: RangeCalibration) -> list[dict[str, Any]]:
    rows, number = [], 0
    for showing in found.showings:
        face = showing.face
        row = {"T_world_hand": showing.T_world_hand.tolist(), "seen": face.found, "reason": face.reason}
        if face.found:
            row |= {"face_range_m": face.middle_range.tolist(), "plane_rms_m": face.rms_m, "area_m2": face.area_m2}
            if found.fit is not None:
                row |= {"residual_m": found.fit.residuals_m[number].tolist(), "used": bool(found.fit.used[number])}
            number += 1
        rows.append(row)
    return rows


def calibration_lines(found: RangeCalibration) -> list[str]:
    """The residual of each pose, the frame with its sigmas, the paper's beside it, how far off the old belief was, and all warnings."""
    fit = found.fit
    if fit is None:
        return [f"not calibrated: {found.reason}"]
    lines = [_pose_line(k, row, bool(used)) for k, (row, used) in enumerate(zip(fit.residuals_m, fit.used, strict=True), start=1)]
    xyz, rpy = to_xyz_rpy(fit.T_world_range)
    sigma, turn = 1e3 * fit.sigma_m, np.rad2deg(fit.sigma_rad[2])
    lines.append(f"range finder at {_mm(xyz)} mm, turned by {np.rad2deg(rpy[2]):.3f}°")
    lines.append(
        f"  known to ± {sigma[0]:.2f}, {sigma[1]:.2f}, {sigma[2]:.2f} mm and ± {turn:.3f}°; residuals {1e3 * fit.rms_m:.2f} mm rms"
    )
    lines.append(f"  it was believed to stand {_off(found.T_world_range_before, fit.T_world_range, fit.middle_range)} off")
    if found.three is not None:
        lines.append(f"  the paper's answer from its three poses is {_off(found.three, fit.T_world_range, fit.middle_range)} off this one")
    warnings = dict.fromkeys((*fit.warnings, *(found.free.warnings if found.free else ())))
    return lines + [f"  note: {text}" for text in ([found.reason] if found.reason else []) + list(warnings)]


def truth_line(found: NDArray, truth: NDArray, middle_range: NDArray) -> str:
    """How far a frame is off the simulated truth, where the cube was shown: known only because the cell is a simulated one."""
    return f"  the simulated range finder really stands {_off(found, truth, middle_range)} off what was found"


def _off(T_a: NDArray, T_b: NDArray, middle_range: NDArray) -> str:
    """How far two frames differ, at a point of the range frame, and by angle."""
    length = 1e3 * float(np.linalg.norm(apply(T_a, middle_range) - apply(T_b, middle_range)))
    return f"{length:.2f} mm and {np.rad2deg(pose_difference(T_a, T_b)[1]):.3f}°"


def _pose_line(number: int, residual: NDArray, used: bool) -> str:
    return f"pose {number}: off by {_mm(residual, 3)} mm{'' if used else ', left out'}"


def _mm(values: NDArray, digits: int = 2) -> str:
    return ", ".join(f"{1e3 * value:.{digits}f}" for value in values)
