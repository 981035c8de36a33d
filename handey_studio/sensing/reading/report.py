"""What was read from a depth file, as the JSON that other programs read."""

from typing import Any

from handey_studio.geometry.transforms import apply
from handey_studio.sensing.depth_view import Pinhole
from handey_studio.sensing.reading.files import DepthReading
from handey_studio.sensing.support import Supports


def seen_report(reading: DepthReading, supports: Supports | None) -> dict[str, Any]:
    """The view with its measured noise, and the supports where they were looked for; metres."""
    view, projection = reading.view, reading.view.projection
    if isinstance(projection, Pinhole):
        kind = {"kind": "pinhole", "fx": projection.fx, "fy": projection.fy, "cx": projection.cx, "cy": projection.cy}
    else:
        kind = {"kind": "orthographic", "pixel_m": projection.pixel, "cx": projection.cx, "cy": projection.cy}
    height, width = view.depth.shape
    size = {"width": width, "height": height, "reduced_by": reading.reduced_by}
    measured = {"noise_m": view.noise, "outline_error_m": view.outline_error}
    report: dict[str, Any] = {"view": kind | size | measured | {"T_file_sensor": reading.T_file_sensor.tolist()}}
    if supports is not None:
        table = supports.table
        report["support"] = {
            "found": table.found,
            "reason": table.reason,
            "share": table.share,
            "rms_m": table.rms,
            "levels_m": [level.height for level in supports.levels],
            "walls": [
                {"normal_world": apply(_turn(supports), wall.normal_sensor).tolist(), "share": wall.share} for wall in supports.walls
            ],
        }
    return report


def _turn(supports: Supports) -> Any:
    T = supports.table.T_world_sensor.copy()
    T[:3, 3] = 0.0
    return T
