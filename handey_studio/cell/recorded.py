"""A recorded cell: it plays depth that was taken before, and writes the motions it is asked for into a folder."""

import json
import os
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.base.files import replace_file
from handey_studio.cell.motions import check_motion, check_opening
from handey_studio.cell.protocol import TOUCH_N, CannotAct, Compliance, Moved, Wrench
from handey_studio.cell.recording import as_commanded
from handey_studio.geometry.transforms import is_rigid
from handey_studio.motion import Trajectory
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.reading.files import read_depth
from handey_studio.sensing.support import support_planes
from handey_studio.sensing.view_map import depth_map_of
from handey_studio.world.robot import Robot

MAX_FILE_BYTES = 200_000_000
MAX_SIDE = 4096
KEYS = ("elevation", "cell", "T_world_range", "passed", "noise", "outline_error")


class RecordedCell:
    """Answers scans with recorded depth maps, one after the other, the last again and again. Not a value: it counts.

    With a folder `out` it takes motions: each is written there as JSON (`handey/motion/1`), and the arm is then taken to be where it
    was sent. Nothing is ever felt: descents and settlings arrive, fingers close on nothing. Without one it cannot act.
    """

    physics = False

    def __init__(self, robot: Robot, scans: Sequence[DepthMap], out: Path | None = None) -> None:
        if not scans:
            raise BadInput("a recorded cell needs at least one depth map to play.")
        self._robot, self._scans, self._out = robot, tuple(scans), out
        self._played = self._written = 0
        self._q, self._opening = robot.home, robot.hand.opening_max

    @classmethod
    def from_files(cls, robot: Robot, paths: Sequence[str | os.PathLike], out: Path | None = None) -> "RecordedCell":
        """The cell that plays depth files: a depth map's `.npz`, or any image or cloud, its camera beside it as `NAME.camera.json`."""
        return cls(robot, [_depth_map(Path(path)) for path in paths], out)

    def scan(self) -> DepthMap:
        self._played += 1
        return self._scans[min(self._played, len(self._scans)) - 1]

    def joints(self) -> NDArray:
        return self._q

    def opening(self) -> float:
        return self._opening

    def wrench(self) -> Wrench:
        return Wrench(np.zeros(3), np.zeros(3))

    def finger_force(self) -> float:
        return 0.0

    def stop(self) -> None:
        """Nothing moves here."""

    def follow(self, motion: Trajectory) -> Moved:
        return self._take("follow", motion, {})

    def descend(self, motion: Trajectory, until_N: float = TOUCH_N) -> Moved:
        return self._take("descend", motion, {"until_N": until_N})

    def settle(self, compliance: Compliance = Compliance()) -> Moved:
        self._write("settle", {"force_N": compliance.force_N, "travel_m": compliance.travel_m})
        return Moved("arrived", as_commanded(np.zeros(1), self._q[None], self._opening))

    def grip(self, opening: float, force_N: float | None = None) -> Moved:
        check_opening(self._robot.hand, opening)
        self._write("grip", {"opening_m": opening, "force_N": self._robot.hand.force if force_N is None else force_N})
        self._opening = float(opening)
        return Moved("arrived", as_commanded(np.zeros(1), self._q[None], self._opening))

    def _take(self, call: str, motion: Trajectory, more: dict[str, Any]) -> Moved:
        """Write a motion, and stand at its end."""
        check_motion(motion, self._robot, self._q)
        content = {key: getattr(motion, key).tolist() for key in ("time_s", "q_rad", "hand_opening_m")}
        self._write(call, {"joint_names": self._robot.joint_names} | content | more)
        self._q, self._opening = motion.q_rad[-1], float(motion.hand_opening_m[-1])
        return Moved("arrived", as_commanded(motion.time_s, motion.q_rad, self._opening))

    def _write(self, call: str, content: dict[str, Any]) -> None:
        if self._out is None:
            raise CannotAct("this cell plays recorded depth and has no arm to move; give it a folder for the motions, or plan only.")
        self._written += 1
        path = self._out / f"{self._written:04d}-{call}.json"
        try:
            self._out.mkdir(parents=True, exist_ok=True)
            replace_file(path, json.dumps({"schema": "handey/motion/1", "call": call, "robot": self._robot.name} | content).encode())
        except OSError as error:
            raise CannotAct(f'the motion cannot be written to "{path}": {error.strerror}.') from None


def _depth_map(path: Path) -> DepthMap:
    """The depth map in a file. Depth whose sensor's place nobody told stands on its own support, which becomes z = 0."""
    if path.suffix.lower() == ".npz":
        return read_depth_map(path)
    camera = path.with_name(f"{path.stem}.camera.json")
    reading = read_depth(path, camera if camera.is_file() else None)
    view = reading.view
    if not reading.knows_world:
        view = replace(view, T_world_sensor=support_planes(view, np.random.default_rng(0)).table.T_world_sensor)
    return depth_map_of(view)


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
