"""What a scan leaves in files: the cloud, and the depth image in the camera's own view."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.base.files import replace_file
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.sensing.depth_view import DepthView, Pinhole
from handey_studio.sensing.stripes.fusing import ScanArea, elevations, rim_of
from handey_studio.sensing.stripes.instrument import Instrument
from handey_studio.sensing.stripes.scan import Scan, with_area

DEPTH_SCALE_MM = 0.1  # of a raw step of a 16-bit depth image: 6.5 m fit
MAX_SIDE_PX = 4096
ROOM_PX = 2  # empty pixels around the image


def scan_view(scan: Scan, instrument: Instrument) -> DepthView:
    """A scan's readings as a depth image from where its first camera stood half way, without the lens, a pixel about a cell.

    In each pixel the nearest surface wins. Raises BadInput without readings.
    """
    sized, _ = with_area(scan, instrument)
    middle = scan.looks[len(scan.looks) // (2 * len(instrument.cameras))]
    T_range_sensor = instrument.cameras[0].T_range_camera.copy()
    T_range_sensor[:3, 3] = middle.eye
    points = apply(inverse(T_range_sensor), scan.points_range)
    points = points[points[:, 2] > 0]
    depth = float(np.median(points[:, 2]))
    uv = points[:, :2] / points[:, 2:] * (depth / sized.cell)
    low, high = np.floor(uv.min(axis=0)) - ROOM_PX, np.ceil(uv.max(axis=0)) + ROOM_PX
    width, height = np.clip(high - low, 1, MAX_SIDE_PX).astype(int).tolist()
    nearness = np.column_stack([(uv - low + 0.5) * sized.cell, -points[:, 2]])
    inside = ((uv - low + 0.5 >= 0) & (uv - low + 0.5 < (width, height))).all(axis=1)
    area = ScanArea((height, width), sized.cell, np.eye(4), scan.noise, np.inf)
    grid, readings = elevations(area, nearness[inside])
    focal = depth / sized.cell
    view = Pinhole(focal, focal, float(-low[0]), float(-low[1]))
    return DepthView(-grid, view, instrument.T_world_range @ T_range_sensor, scan.noise / np.sqrt(readings), sized.cell, rim_of(readings))


def write_cloud(path: Path, points_world: NDArray) -> None:
    """Points (n, 3) [m] as a binary PLY. Raises BadInput for another suffix, OSError."""
    if path.suffix.lower() != ".ply":
        raise BadInput(f'the cloud "{path}" has the suffix "{path.suffix}"; it must be .ply.')
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points_world)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    replace_file(path, header.encode() + np.ascontiguousarray(points_world, dtype="<f4").tobytes())


def write_view(path: Path, view: DepthView) -> tuple[Path, ...]:
    """A depth image as an organised cloud (`.npy`, metres), or as 16-bit `.png`; the camera goes beside it as JSON. The files written."""
    camera = path.with_name(f"{path.stem}.camera.json")
    if path.suffix.lower() == ".npy":
        with path.open("wb") as file:
            np.save(file, view.points_sensor())
    elif path.suffix.lower() == ".png":
        raw = np.nan_to_num(np.round(view.depth * (1e3 / DEPTH_SCALE_MM)), nan=0.0)
        replace_file(path, cv2.imencode(".png", np.clip(raw, 0, 65535).astype(np.uint16))[1].tobytes())
    else:
        raise BadInput(f'the depth file "{path}" has the suffix "{path.suffix}"; it must be one of .npy, .png, .npz.')
    replace_file(camera, (json.dumps(_camera(view), indent=1) + "\n").encode())
    return path, camera


def _camera(view: DepthView) -> dict[str, Any]:
    """The camera in the BOP convention."""
    if not isinstance(view.projection, Pinhole):
        raise BadInput("an orthographic view has no camera.")
    height, width = view.depth.shape
    lens = {key: getattr(view.projection, key) for key in ("fx", "fy", "cx", "cy")}
    return lens | {"width": width, "height": height, "depth_scale": DEPTH_SCALE_MM, "T_world_sensor": view.T_world_sensor.tolist()}
