"""Reading depth from files: 16-bit images with a camera in the BOP convention, and clouds."""

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.geometry.transforms import is_rigid
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole
from handey_studio.sensing.noise import noise_of
from handey_studio.sensing.outlines import measured_outline_error
from handey_studio.sensing.reading.cloud_views import UNITS_M, view_of_cloud
from handey_studio.sensing.reading.clouds import MAX_CLOUD_BYTES, MAX_SIDE, Cloud, read_npy
from handey_studio.sensing.reading.pcd import read_pcd
from handey_studio.sensing.reading.ply import read_ply
from handey_studio.sensing.reading.reduce import reduced

MAX_CAMERA_BYTES = 1_000_000
MAX_DEPTH_M = 100.0
MIN_READINGS = 100
CLOUDS = {".npy": read_npy, ".ply": read_ply, ".pcd": read_pcd}


@dataclass(frozen=True, eq=False)
class DepthReading(Value):
    """A depth view from a file. `knows_world` tells whether the file said where the sensor stands; without that the
    view's world is its sensor's frame, and `support_plane` can find a better one.

    `T_file_sensor` (4, 4) takes the view's sensor frame to the frame that the file's points are in: the identity but for clouds in
    other frames than their sensor's. The view has one pixel for `reduced_by` × `reduced_by` of the file's.
    """

    view: DepthView
    knows_world: bool
    T_file_sensor: NDArray = field(default_factory=lambda: np.eye(4))
    reduced_by: int = 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_file_sensor", frozen_array(self.T_file_sensor))


def read_depth(depth_path: str | os.PathLike, camera_path: str | os.PathLike | None = None, cloud_unit: str = "m") -> DepthReading:
    """A depth image or a cloud as a view.

    A 16-bit PNG holds raw × depth_scale = millimetres along the optical axis, 0 = no reading, and needs the camera's
    JSON (fx, fy, cx, cy, depth_scale, optional width, height and T_world_sensor). Clouds are `.npy` arrays (H, W, 3) or (n, 3), PLY and
    PCD files with coordinates in `cloud_unit`, one of m, cm, mm; NaN = no reading. An organised cloud's pinhole is found by least
    squares when no camera is given; other clouds become an image as `grid_points` tells. Noise and outline error are measured.
    Raises BadInput with one sentence.
    """
    path = Path(depth_path)
    camera = None if camera_path is None else _read_camera(Path(camera_path))
    _check_size(path, MAX_CLOUD_BYTES, "depth file")
    suffix = path.suffix.lower()
    if suffix != ".png" and suffix not in CLOUDS:
        raise BadInput(f'depth file "{path}" has the suffix "{path.suffix}"; it must be one of .png, {", ".join(CLOUDS)}.')
    if suffix == ".png":
        if camera is None:
            raise BadInput(f'depth image "{path}" needs a camera file with fx, fy, cx, cy and depth_scale.')
        scale = _number(camera, "depth_scale", low=1e-6, high=1e4)
        depth, projection, T_file_sensor, quantum = _read_png(path, scale), _pinhole(camera), np.eye(4), 1e-3 * scale
    else:
        if cloud_unit not in UNITS_M:
            raise BadInput(f'the cloud\'s unit "{cloud_unit}" is not known; choose one of: {", ".join(UNITS_M)}.')
        pinhole = None if camera is None else _pinhole(camera)
        depth, projection, T_file_sensor = view_of_cloud(path, _read_cloud(path, suffix), UNITS_M[cloud_unit], pinhole, _size_of(camera))
        quantum = 0.0
    return _reading(path, depth, projection, camera or {}, quantum, T_file_sensor)


def _reading(
    path: Path, depth: NDArray, projection: Pinhole | Orthographic, camera: dict[str, Any], quantum: float, T_file_sensor: NDArray
) -> DepthReading:
    readings = _only_readings(depth)
    if readings < MIN_READINGS:
        raise BadInput(
            f'depth file "{path}" has {readings} readings between 0 and {MAX_DEPTH_M:.0f} m; at least {MIN_READINGS} are needed.'
        )
    for key, size in (("width", depth.shape[1]), ("height", depth.shape[0])):
        if key in camera and _number(camera, key) != size:
            raise BadInput(f'depth file "{path}" is {depth.shape[1]} × {depth.shape[0]} px, but its camera says {key} {camera[key]}.')
    given = camera.get("T_world_sensor")
    T_world_sensor = np.eye(4) if given is None else _rigid(given)
    depth, projection, factor = reduced(depth, projection)
    noise = noise_of(depth, projection, quantum)
    outline = measured_outline_error(depth, projection, noise.sigma)
    view = DepthView(depth, projection, T_world_sensor, noise.sigma, outline)
    return DepthReading(view, given is not None, T_file_sensor, factor)


def _only_readings(depth: NDArray) -> int:
    """Make what is no reading NaN, in place and a few rows at a time; how many readings are left."""
    count = 0
    for start in range(0, len(depth), 256):
        rows = depth[start : start + 256]
        rows[~((rows > 0) & (rows <= MAX_DEPTH_M))] = np.nan
        count += int(np.isfinite(rows).sum())
    return count


def _read_cloud(path: Path, suffix: str) -> Cloud:
    try:
        return CLOUDS[suffix](path)
    except OSError as error:
        raise BadInput(f'cloud "{path}" cannot be read: {error.strerror}.') from None


def _size_of(camera: dict[str, Any] | None) -> tuple[int, int] | None:
    """(height, width) [px] that a camera names."""
    if camera is None or "width" not in camera or "height" not in camera:
        return None
    height, width = (int(_number(camera, key, low=1, high=MAX_SIDE)) for key in ("height", "width"))
    return height, width


def _check_size(path: Path, limit: int, kind: str) -> None:
    try:
        size = path.stat().st_size
    except FileNotFoundError:
        raise BadInput(f'{kind} "{path}" does not exist.') from None
    except OSError as error:
        raise BadInput(f'{kind} "{path}" cannot be read: {error.strerror}.') from None
    if not path.is_file():
        raise BadInput(f'{kind} "{path}" is not a file.')
    if size > limit:
        raise BadInput(f'{kind} "{path}" has {size} bytes, the limit is {limit}.')


def _check_sides(path: Path, width: int, height: int) -> None:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise BadInput(f'depth file "{path}" is {width} × {height} px, the limit is {MAX_SIDE} × {MAX_SIDE}.')


def _read_png(path: Path, depth_scale: float) -> NDArray:
    """Depth (H, W) [m], 0 = no reading."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BadInput(f'depth image "{path}" cannot be read: {error.strerror}.') from None
    if content[:8] != b"\x89PNG\r\n\x1a\n" or len(content) < 33:
        raise BadInput(f'depth image "{path}" is not a PNG file.')
    _check_sides(path, int.from_bytes(content[16:20], "big"), int.from_bytes(content[20:24], "big"))
    try:
        raw = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        raw = None
    if raw is None:
        raise BadInput(f'depth image "{path}" is damaged and cannot be decoded.')
    if raw.dtype != np.uint16 or raw.ndim != 2:
        channels = 1 if raw.ndim == 2 else raw.shape[2]
        raise BadInput(f'depth image "{path}" has {channels} channels of {raw.dtype}; it must have one channel of uint16.')
    return raw * (depth_scale * 1e-3)


def _read_camera(path: Path) -> dict[str, Any]:
    _check_size(path, MAX_CAMERA_BYTES, "camera file")
    try:
        camera = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise BadInput(f'camera file "{path}" cannot be read as JSON: {error}.') from None
    if not isinstance(camera, dict):
        raise BadInput(f'camera file "{path}" must hold an object with fx, fy, cx, cy and depth_scale.')
    return camera


def _number(camera: dict[str, Any], key: str, low: float = -1e6, high: float = 1e6) -> float:
    if key not in camera:
        raise BadInput(f"the camera lacks {key}; it must have fx, fy, cx, cy and depth_scale.")
    value = camera[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise BadInput(f"the camera's {key} is {str(value)[:40]!r}; it must be a number from {low:g} to {high:g}.")
    return float(value)


def _pinhole(camera: dict[str, Any]) -> Pinhole:
    return Pinhole(_number(camera, "fx", low=1.0), _number(camera, "fy", low=1.0), _number(camera, "cx"), _number(camera, "cy"))


def _rigid(given: Any) -> NDArray:
    try:
        T = np.array(given, dtype=float).reshape(4, 4)
    except (TypeError, ValueError):
        raise BadInput("the camera's T_world_sensor must be 4 × 4 numbers, row by row.") from None
    if not is_rigid(T, tolerance=1e-4):
        raise BadInput("the camera's T_world_sensor is not a rigid transform: a proper rotation, metres, last row 0 0 0 1.")
    return T
