"""A recorded cell: it plays a depth map that was taken before, and cannot act."""

import os
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.cell.protocol import TOUCH_N, CannotAct, Compliance, Moved, Wrench
from handey_studio.geometry.transforms import is_rigid
from handey_studio.motion import Trajectory
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.world.robot import Robot

MAX_FILE_BYTES = 200_000_000
MAX_SIDE = 4096
KEYS = ("elevation", "cell", "T_world_range", "passed", "noise", "outline_error")


class RecordedCell:
    """Answers every scan with one recorded depth map. The arm stands at its home and cannot move."""

    physics = False

    def __init__(self, robot: Robot, depth_map: DepthMap) -> None:
        self._robot, self._map = robot, depth_map

    @classmethod
    def from_file(cls, robot: Robot, path: str | os.PathLike) -> "RecordedCell":
        """The cell that plays a depth map's `.npz` file."""
        return cls(robot, read_depth_map(path))

    def scan(self) -> DepthMap:
        return self._map

    def joints(self) -> NDArray:
        return self._robot.home

    def opening(self) -> float:
        return self._robot.hand.opening_max

    def wrench(self) -> Wrench:
        return Wrench(np.zeros(3), np.zeros(3))

    def finger_force(self) -> float:
        return 0.0

    def stop(self) -> None:
        """Nothing moves here."""

    def follow(self, motion: Trajectory) -> Moved:
        raise _refusal()

    def descend(self, motion: Trajectory, until_N: float = TOUCH_N) -> Moved:
        raise _refusal()

    def settle(self, compliance: Compliance = Compliance()) -> Moved:
        raise _refusal()

    def grip(self, opening: float, force_N: float | None = None) -> Moved:
        raise _refusal()


def _refusal() -> CannotAct:
    return CannotAct("this cell plays a recorded depth map and has no arm to move; plan here, and execute in a simulated or a real cell.")


def write_depth_map(path: str | os.PathLike, depth_map: DepthMap) -> None:
    """Keep a depth map as a compressed `.npz` of plain arrays."""
    np.savez_compressed(Path(path), allow_pickle=False, **{key: np.asarray(getattr(depth_map, key)) for key in KEYS})


def read_depth_map(path: str | os.PathLike) -> DepthMap:
    """A depth map written by `write_depth_map`. Raises BadInput with one sentence."""
    path = Path(path)
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise BadInput(f'the depth map "{path}" has {path.stat().st_size} bytes; the limit is {MAX_FILE_BYTES}.')
        with np.load(path, allow_pickle=False) as stored:
            arrays = {key: np.asarray(stored[key]) for key in KEYS}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile, EOFError) as error:
        if isinstance(error, BadInput):
            raise
        raise BadInput(f'"{path}" cannot be read as a depth map: {error}.') from None
    return _checked(path, arrays)


def _checked(path: Path, arrays: dict[str, NDArray]) -> DepthMap:
    elevation, passed = arrays["elevation"], arrays["passed"]
    if elevation.ndim != 2 or min(elevation.shape) < 2 or max(elevation.shape) > MAX_SIDE or passed.shape != elevation.shape:
        raise BadInput(f'the depth map "{path}" has the shape {elevation.shape}; it takes two sides of 2 to {MAX_SIDE} cells.')
    if not np.isfinite(elevation).any():
        raise BadInput(f'the depth map "{path}" holds no reading; every one of its {elevation.size} cells is empty.')
    if not is_rigid(arrays["T_world_range"]) or not np.isfinite(passed).all():
        raise BadInput(f'the depth map "{path}" needs a rigid T_world_range (4, 4) and finite heights of the light that passed.')
    numbers = {key: float(arrays[key]) for key in ("cell", "noise", "outline_error")}
    if not all(np.isfinite(value) and value > 0 for value in numbers.values()):
        raise BadInput(f'the depth map "{path}" gives {numbers}; each must be a length above 0 m.')
    return DepthMap(elevation, T_world_range=arrays["T_world_range"], passed=passed, **numbers)
