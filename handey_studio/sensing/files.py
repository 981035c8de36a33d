"""Reading depth from files: 16-bit images with a camera in the BOP convention, and organised clouds."""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value
from handey_studio.geometry.transforms import is_rigid
from handey_studio.sensing.depth_view import DepthView, Pinhole
from handey_studio.sensing.noise import measured_noise
from handey_studio.sensing.outlines import measured_outline_error

MAX_SIDE_PX = 4096
MAX_DEPTH_BYTES = 420_000_000  # a cloud of 4096 × 4096 points of three float64 numbers, and its header
MAX_CAMERA_BYTES = 1_000_000
MAX_DEPTH_M = 100.0
PINHOLE_RMS_PX = 1.0  # an organised cloud whose points miss the best pinhole's pixels by more is no single image
MIN_READINGS = 100


@dataclass(frozen=True, eq=False)
class DepthReading(Value):
    """A depth view from a file. `knows_world` tells whether the file said where the sensor stands; without that the
    view's world is its sensor's frame, and `support_plane` can find a better one."""

    view: DepthView
    knows_world: bool


def read_depth(depth_path: str | os.PathLike, camera_path: str | os.PathLike | None = None) -> DepthReading:
    """A depth image or an organised cloud as a view.

    A 16-bit PNG holds raw × depth_scale = millimetres along the optical axis, 0 = no reading, and needs the camera's
    JSON (fx, fy, cx, cy, depth_scale, optional width, height and T_world_sensor). An organised `.npy` holds
    (H, W, 3) metres in the sensor's frame, NaN = no reading; its pinhole is found by least squares when no camera is
    given. Raises BadInput with one sentence.
    """
    path = Path(depth_path)
    camera = None if camera_path is None else _read_camera(Path(camera_path))
    _check_size(path, MAX_DEPTH_BYTES, "depth file")
    if path.suffix.lower() == ".png":
        if camera is None:
            raise BadInput(f'depth image "{path}" needs a camera file with fx, fy, cx, cy and depth_scale.')
        scale = _number(camera, "depth_scale", low=1e-6, high=1e4)
        depth, quantum = _read_png(path, scale), 1e-3 * scale
        pinhole = _pinhole(camera)
    elif path.suffix.lower() == ".npy":
        points = _read_cloud(path)
        depth, quantum = points[..., 2], 0.0
        pinhole = _fit_pinhole(points, path) if camera is None else _pinhole(camera)
    else:
        raise BadInput(f'depth file "{path}" has the suffix "{path.suffix}"; it must be one of .png, .npy.')
    return _reading(path, depth, pinhole, camera or {}, quantum)


def _reading(path: Path, depth: NDArray, pinhole: Pinhole, camera: dict[str, Any], quantum: float) -> DepthReading:
    depth = np.where(np.isfinite(depth) & (depth > 0) & (depth <= MAX_DEPTH_M), depth, np.nan)
    readings = int(np.isfinite(depth).sum())
    if readings < MIN_READINGS:
        raise BadInput(
            f'depth file "{path}" has {readings} readings between 0 and {MAX_DEPTH_M:.0f} m; at least {MIN_READINGS} are needed.'
        )
    for key, size in (("width", depth.shape[1]), ("height", depth.shape[0])):
        if key in camera and _number(camera, key) != size:
            raise BadInput(f'depth file "{path}" is {depth.shape[1]} × {depth.shape[0]} px, but its camera says {key} {camera[key]}.')
    given = camera.get("T_world_sensor")
    T_world_sensor = np.eye(4) if given is None else _rigid(given)
    noise = measured_noise(depth, pinhole, quantum)
    outline = measured_outline_error(depth, pinhole, noise)
    return DepthReading(DepthView(depth, pinhole, T_world_sensor, noise=noise, outline_error=outline), given is not None)


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
    if not (1 <= width <= MAX_SIDE_PX and 1 <= height <= MAX_SIDE_PX):
        raise BadInput(f'depth file "{path}" is {width} × {height} px, the limit is {MAX_SIDE_PX} × {MAX_SIDE_PX}.')


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
    return raw.astype(float) * (depth_scale * 1e-3)


def _read_cloud(path: Path) -> NDArray:
    """Points (H, W, 3) [m]."""
    try:
        cloud = np.load(path, allow_pickle=False, mmap_mode="r")
    except (OSError, ValueError, EOFError, SyntaxError) as error:
        raise BadInput(f'organised cloud "{path}" cannot be read as an array: {str(error).splitlines()[0]}') from None
    if not isinstance(cloud, np.ndarray) or cloud.ndim != 3 or cloud.shape[2] != 3 or cloud.dtype.kind != "f":
        shape = getattr(cloud, "shape", "unknown")
        raise BadInput(f'organised cloud "{path}" has shape {shape}; it must be (H, W, 3) floating-point metres.')
    _check_sides(path, cloud.shape[1], cloud.shape[0])
    points = np.array(cloud, dtype=float)
    points[~np.isfinite(points).all(axis=-1)] = np.nan
    return points


def _fit_pinhole(points: NDArray, path: Path) -> Pinhole:
    """The pinhole that saw an organised cloud, by least squares over its pixels."""
    v, u = np.nonzero(np.isfinite(points[..., 2]) & (points[..., 2] > 0))
    if len(u) < MIN_READINGS:
        raise BadInput(f'organised cloud "{path}" has {len(u)} readings in front of the sensor; at least {MIN_READINGS} are needed.')
    x, y, z = points[v, u].T
    numbers, worst = [], 0.0
    for ratio, pixel in ((x / z, u), (y / z, v)):
        (f, c), *_ = np.linalg.lstsq(np.c_[ratio, np.ones(len(ratio))], pixel.astype(float), rcond=None)
        worst = max(worst, float(np.sqrt(np.mean((f * ratio + c - pixel) ** 2))))
        numbers += [float(f), float(c)]
    fx, cx, fy, cy = numbers
    if worst > PINHOLE_RMS_PX or min(fx, fy) <= 0:
        raise BadInput(
            f'organised cloud "{path}" is not the image of one pinhole (its points miss their pixels by {worst:.3g} px rms, the limit is '
            f"{PINHOLE_RMS_PX:g}); give the camera, or a cloud as one camera sees it."
        )
    return Pinhole(fx, fy, cx, cy)


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
