"""What was located as the JSON that other programs read (schema `handey/locate/1`)."""

from typing import Any

from numpy.typing import NDArray

from handey_studio.localization.result import LocateResult


def locate_report(result: LocateResult, T_world_sensor: NDArray, timing_s: dict[str, float]) -> dict[str, Any]:
    """The poses, best first, and how many assignments and hypotheses fell for each reason."""
    return {
        "schema": "handey/locate/1",
        "T_world_sensor": T_world_sensor.tolist(),
        "poses": [
            {
                "part": pose.part,
                "T_world_part": pose.T_world_part.tolist(),
                "T_sensor_part": pose.T_sensor_part.tolist(),
                "score": pose.score,
                "edges_predicted": pose.edges_predicted,
                "edges_found": pose.edges_found,
                "visible_fraction": pose.visible_fraction,
                "surface_rms_m": pose.surface_rms_m,
                "rivals": [
                    {"part": rival.part, "T_world_part": rival.T_world_part.tolist(), "probability": rival.probability}
                    for rival in pose.rivals
                ],
            }
            for pose in result.poses
        ],
        "timing_s": timing_s | result.timing_s,
        "rejected": result.rejected,
        "reason": result.reason,
    }
