"""The range finder's parameters in a file: JSON, schema `handey/range-finder/1`. The guide's page on scanning tells each key."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.base.files import replace_file
from handey_studio.geometry.transforms import is_rigid
from handey_studio.sensing.stripes.instrument import MAX_CELL_M, MIN_CELL_M, Instrument
from handey_studio.sensing.stripes.laser_planes import plane_through, turning_planes
from handey_studio.sensing.stripes.stripe_camera import LENS_COEFFICIENTS, StripeCamera

SCHEMA = "handey/range-finder/1"
MAX_BYTES = 5_000_000
MAX_CAMERAS = 16
MAX_PLANES = 5000
FAR_M = 1e3


def read_instrument(path: Path) -> Instrument:
    """The instrument of a file. Raises BadInput with one sentence that names the file and the key."""
    given = _read(path)
    try:
        return _instrument(given)
    except BadInput as error:
        raise BadInput(f'range finder file "{path}": {error}') from None


def write_instrument(path: Path, instrument: Instrument, calibration: dict[str, Any] | None = None) -> None:
    """Write an instrument, and what its calibration found (`calibration`, plain JSON, for people to read). Raises OSError."""
    laser: dict[str, Any] = (
        {"planes": instrument.planes.tolist()} if len(instrument.planes) > 1 else {"plane": instrument.planes[0].tolist()}
    )
    if instrument.laser is not None:
        laser["source_m"] = instrument.laser.tolist()
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "cameras": [_plain_camera(name, camera) for name, camera in zip(instrument.names, instrument.cameras, strict=True)],
        "laser": laser,
        "T_world_range": instrument.T_world_range.tolist(),
        "cell_m": instrument.cell,
        "max_height_m": instrument.max_height,
    }
    if instrument.area is not None:
        content["area_m"] = list(instrument.area)
    if instrument.rig is not None:
        content["rig"] = {"poses": instrument.rig.tolist()}
    if instrument.rig_step is not None:
        content["rig"] = {"step": instrument.rig_step.tolist()}
    if calibration is not None:
        content["calibration"] = calibration
    replace_file(path, (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())


def _plain_camera(name: str, camera: StripeCamera) -> dict[str, Any]:
    view = camera.projection
    return {
        "name": name,
        "width": camera.width,
        "height": camera.height,
        "fx": view.fx,
        "fy": view.fy,
        "cx": view.cx,
        "cy": view.cy,
        "distortion": list(camera.distortion),
        "T_range_camera": camera.T_range_camera.tolist(),
    }


def _read(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise BadInput(f'range finder file "{path}" has {path.stat().st_size} bytes, the limit is {MAX_BYTES}.')
        given = json.loads(path.read_text())
    except OSError as error:
        raise BadInput(f'range finder file "{path}" cannot be read: {error.strerror}.') from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f'range finder file "{path}" is not JSON: {str(error).splitlines()[0]}.') from None
    if not isinstance(given, dict) or given.get("schema") != SCHEMA:
        raise BadInput(f'range finder file "{path}" must be an object with "schema": "{SCHEMA}".')
    return given


def _instrument(given: dict[str, Any]) -> Instrument:
    cameras = given.get("cameras")
    if not isinstance(cameras, list) or not 1 <= len(cameras) <= MAX_CAMERAS or not all(isinstance(one, dict) for one in cameras):
        raise BadInput(f'"cameras" must be a list of 1 to {MAX_CAMERAS} objects.')
    laser, rig = _object(given, "laser"), _object(given, "rig") if "rig" in given else {}
    if "rig" in given and not rig.keys() & {"step", "poses"}:
        raise BadInput('"rig" needs "step" or "poses".')
    return Instrument(
        cameras=tuple(_camera(one) for one in cameras),
        names=tuple(_name(one) for one in cameras),
        planes=_planes(laser),
        laser=_numbers(laser, "source_m", (3,)) if "source_m" in laser else None,
        rig=_rigid(rig, "poses", (None, 4, 4)) if "poses" in rig else None,
        rig_step=_rigid(rig, "step") if "step" in rig else None,
        T_world_range=_rigid(given, "T_world_range") if "T_world_range" in given else np.eye(4),
        area=_pair(given, "area_m") if "area_m" in given else None,
        cell=_number(given, "cell_m", MIN_CELL_M, MAX_CELL_M) if "cell_m" in given else 0.001,
        max_height=_number(given, "max_height_m", 0.001, 10.0) if "max_height_m" in given else 1.0,
    )


def _camera(given: dict[str, Any]) -> StripeCamera:
    fx, fy = _number(given, "fx", 1.0, 1e6), _number(given, "fy", 1.0, 1e6)
    width, height = (round(_number(given, key, 1, 8192)) for key in ("width", "height"))
    lens = _numbers(given, "distortion", (None,), 100.0) if given.get("distortion") else np.zeros(0)
    if len(lens) not in LENS_COEFFICIENTS:
        raise BadInput(f'"distortion" has {len(lens)} numbers; it takes one of {LENS_COEFFICIENTS}, in OpenCV\'s order.')
    return StripeCamera(
        _rigid(given, "T_range_camera"),
        focal_px=fx,
        width=width,
        height=height,
        aspect=fy / fx,
        centre_px=(_number(given, "cx", -1e5, 1e5), _number(given, "cy", -1e5, 1e5)),
        distortion=tuple(lens.tolist()),
    )


def _planes(laser: dict[str, Any]) -> NDArray:
    """Planes (n, 4) from whichever of the three ways the file gives them."""
    ways = [way for way in ("plane", "planes", "turning") if way in laser]
    if len(ways) != 1:
        raise BadInput(f'"laser" must have one of "plane", "planes", "turning"; it has {ways or "none"}.')
    if ways[0] == "turning":
        turning = _object(laser, "turning")
        angles = np.deg2rad(_numbers(turning, "angles_deg", (None,)))
        axis = plane_through(_numbers(turning, "axis", (3,)), np.zeros(3))[:3]
        return turning_planes(_numbers(turning, "point_m", (3,)), axis, _numbers(turning, "normal", (3,)), angles)
    planes = _numbers(laser, "plane", (4,))[None] if ways[0] == "plane" else _numbers(laser, "planes", (None, 4))
    lengths = np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    if lengths.min() < 1e-9:
        raise BadInput("a laser plane's normal is all zero.")
    return planes / lengths


def _object(given: dict[str, Any], key: str) -> dict[str, Any]:
    if not isinstance(given.get(key), dict):
        raise BadInput(f'"{key}" must be an object.')
    return given[key]


def _name(camera: dict[str, Any]) -> str:
    name = camera.get("name", "")
    if not isinstance(name, str) or len(name) > 80:
        raise BadInput('a camera\'s "name" must be a text of up to 80 characters.')
    return name


def _number(given: dict[str, Any], key: str, low: float, high: float) -> float:
    value = given.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise BadInput(f'"{key}" is {str(value)[:40]!r}; it must be a number from {low:g} to {high:g}.')
    return float(value)


def _numbers(given: dict[str, Any], key: str, shape: tuple[int | None, ...], limit: float = FAR_M) -> NDArray:
    """An array of a shape in which None stands for any count up to MAX_PLANES."""
    try:
        array = np.array(given.get(key), dtype=float)
    except (TypeError, ValueError):
        array = np.zeros(())
    fits = array.ndim == len(shape) and all(
        side == want if want else 0 < side <= MAX_PLANES for side, want in zip(array.shape, shape, strict=False)
    )
    if not fits or not np.isfinite(array).all() or np.abs(array).max() > limit:
        wanted = " × ".join("n" if side is None else str(side) for side in shape)
        raise BadInput(f'"{key}" must be {wanted} numbers, none beyond ±{limit:g}.')
    return array


def _pair(given: dict[str, Any], key: str) -> tuple[float, float]:
    x, y = _numbers(given, key, (2,)).tolist()
    return x, y


def _rigid(given: dict[str, Any], key: str, shape: tuple[int | None, ...] = (4, 4)) -> NDArray:
    """Transforms (…, 4, 4); rotations that were written with few digits are made exact."""
    Ts = _numbers(given, key, shape)
    for T in Ts.reshape(-1, 4, 4):
        if not is_rigid(T, 1e-4):
            raise BadInput(f'"{key}" is not a rigid transform: a proper rotation, metres, last row 0 0 0 1.')
        u, _, vh = np.linalg.svd(T[:3, :3])
        T[:3, :3] = u @ vh
    return Ts
