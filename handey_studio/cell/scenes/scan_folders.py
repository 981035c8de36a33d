"""Folders of simulated photographs, laid out as a real range finder's: to try `handey scan` on, without hardware.

A `stage`: one camera with a real lens and one plane of light, on a stage that moves over the table in equal steps; with
photographs of a chessboard, so that all of it can be calibrated. A `sweep`: the cell's own range finder, two cameras at rest and a
turning plane.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Progress, Silent
from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.chessboard import THICK_M, Chessboard, board_poses, painted
from handey_studio.cell.photographs import Exposure, Paint, body_paint, develop, look, stripe_light
from handey_studio.cell.stripes import Surfaces
from handey_studio.geometry.transforms import apply, inverse, transform
from handey_studio.sensing.stripes.instrument import MAX_CELL_M, Instrument, instrument_of
from handey_studio.sensing.stripes.instrument_file import write_instrument
from handey_studio.sensing.stripes.laser_planes import moved_planes
from handey_studio.sensing.stripes.range_finder import RangeFinder
from handey_studio.sensing.stripes.stripe_camera import StripeCamera, camera_looking_at

TRUE_FILE = "true-range-finder.json"
BOARDS, STRIPES, MOVED, LASER = "boards", "stripes", "moved", "laser"
BRIGHT = 4.0  # the room's light on the board's photographs, times that on the stripes'
LENS = (-0.11, 0.07, 0.0006, -0.0004, 0.0)
LEAN_RAD = np.deg2rad(4.0)  # of the stage's laser: nothing in a real rig is upright
LASER_HEIGHT_M = 0.6
MOVED_M = 0.05  # about how far the stage moves between the two photographs that tell its step


@dataclass(frozen=True)
class FolderOptions:
    """`stripes` photographs of stripes, and `boards` poses of the chessboard."""

    stripes: int = 100
    boards: int = 10
    exposure: Exposure = field(default_factory=Exposure)

    def __post_init__(self) -> None:
        if not 2 <= self.stripes <= 2000 or not 3 <= self.boards <= 100:
            raise BadInput(f"{self.stripes} stripes and {self.boards} boards: they take 2 to 2000 and 3 to 100.")


def stage_camera() -> StripeCamera:
    """The stage's camera: 720 × 560 px, half a metre above the table, 27° off the laser's plane, with a lens."""
    camera = camera_looking_at((-0.26, 0.0, 0.5), (0.01, 0.0, 0.03))
    return replace(camera, focal_px=1050.0, width=720, height=560, centre_px=(365.2, 276.4), aspect=1.001, distortion=LENS)


def stage_instrument(finder: RangeFinder, stripes: int) -> Instrument:
    """The stage over a range finder's area, in its range frame: it steps along x from one end to the other, in the middle of y."""
    width, depth = finder.area
    T_range_start = transform(None, (0.0, depth / 2, 0.0))
    camera = stage_camera()
    return Instrument(
        cameras=(replace(camera, T_range_camera=T_range_start @ camera.T_range_camera),),
        names=("",),
        planes=np.array([[np.cos(LEAN_RAD), 0.0, -np.sin(LEAN_RAD), 0.0]]),
        laser=apply(T_range_start, (LASER_HEIGHT_M * np.tan(LEAN_RAD), 0.0, LASER_HEIGHT_M)),
        rig_step=transform(None, (width / (stripes - 1), 0.0, 0.0)),
        T_world_range=finder.T_world_range,
        area=finder.area,
        cell=_cell(finder, width / stripes),
        max_height=finder.max_height,
    )


def _cell(finder: RangeFinder, spacing: float) -> float:
    """Side [m] of cells in which every stripe leaves a reading."""
    return min(max(finder.cell, round(spacing, 4)), MAX_CELL_M)


def moved_steps(instrument: Instrument) -> int:
    """How many steps the stage makes between the board's photographs `00` and `00.moved`."""
    step = 0.0 if instrument.rig_step is None else float(np.linalg.norm(instrument.rig_step[:3, 3]))
    return max(1, round(MOVED_M / max(step, 1e-6)))


def write_stage_folder(
    folder: Path,
    finder: RangeFinder,
    bodies: Sequence[SolidBody],
    options: FolderOptions,
    rng: np.random.Generator,
    progress: Progress = Silent(),
) -> Instrument:
    """Photographs as a stage's camera takes them, in `folder`/boards and `folder`/stripes; the true instrument, which is written too.

    `bodies` stand in the world. Raises BadInput when the folder cannot be written or is there already.
    """
    instrument = stage_instrument(finder, options.stripes)
    _new_folders(folder, BOARDS, STRIPES)
    _write_true(folder, instrument)
    placed = _in_range(bodies, finder)
    _write_boards(folder / BOARDS, instrument, [body for body in placed if body.fixed], options, rng, progress)
    surfaces, paint = Surfaces(placed, np.eye(4)), body_paint(placed)
    for k, T_range_rig in enumerate(instrument.rig_of(options.stripes)):
        if progress.cancelled:
            break
        progress.report(0.2 + 0.8 * k / options.stripes, f"stripe {k + 1} of {options.stripes}")
        light = _light(instrument, T_range_rig, surfaces, paint, options.exposure)
        _write(folder / STRIPES / f"{k:04d}.png", develop(*light, options.exposure, rng))
    return instrument


def _write_boards(
    folder: Path, instrument: Instrument, table: list[SolidBody], options: FolderOptions, rng: np.random.Generator, progress: Progress
) -> None:
    """The board's photographs: the first flat on the table, and again after the stage moved; the others held before the camera."""
    exposure = replace(options.exposure, room=BRIGHT * options.exposure.room)
    _, y, _ = instrument.cameras[0].T_range_camera[:3, 3]
    poses = [transform(None, (0.0, y, THICK_M)) @ T for T in board_poses(options.boards, rng)]
    stands = [(f"{k:02d}", np.eye(4), T) for k, T in enumerate(poses)]
    stands.append((f"00.{MOVED}", instrument.rig_of(moved_steps(instrument) + 1)[-1], poses[0]))
    for k, (name, T_range_rig, T_range_board) in enumerate(stands):
        if progress.cancelled:
            return
        progress.report(0.2 * k / len(stands), f"board {name}")
        bodies, paint = painted(Chessboard(T_range_board), table)
        room, stripe = _light(instrument, T_range_rig, Surfaces(bodies, np.eye(4)), paint, exposure)
        _write(folder / f"{name}.png", develop(room, None, exposure, rng))
        if not name.endswith(MOVED):
            _write(folder / f"{name}.{LASER}.png", develop(room, stripe, exposure, rng))


def _light(instrument: Instrument, T_range_rig: NDArray, surfaces: Surfaces, paint: Paint, exposure: Exposure) -> tuple[NDArray, NDArray]:
    """The room's and the stripe's light (H, W) before the stage's camera."""
    camera = replace(instrument.cameras[0], T_range_camera=T_range_rig @ instrument.cameras[0].T_range_camera)
    plane = moved_planes(T_range_rig, instrument.planes[0])
    laser = np.zeros(3) if instrument.laser is None else apply(T_range_rig, instrument.laser)
    room, seen = look(camera, surfaces, paint, exposure, plane)
    return room, stripe_light(seen, surfaces, plane, laser, exposure)


def write_sweep_folder(
    folder: Path,
    finder: RangeFinder,
    bodies: Sequence[SolidBody],
    options: FolderOptions,
    rng: np.random.Generator,
    progress: Progress = Silent(),
) -> Instrument:
    """Photographs as a range finder's cameras take them while its plane turns, in `folder`/stripes, with a dark frame for each camera.

    The range finder's planes are as many as `options.stripes`. Raises BadInput when the folder cannot be written or is there already.
    """
    finder = replace(finder, planes=options.stripes)
    spacing = 2.0 * float(finder.laser[2]) * finder.sweep_rad / (finder.planes - 1)
    instrument = replace(instrument_of(finder), cell=_cell(finder, spacing))
    _new_folders(folder, STRIPES)
    _write_true(folder, instrument)
    placed = _in_range(bodies, finder)
    surfaces, paint, exposure = Surfaces(placed, np.eye(4)), body_paint(placed), options.exposure
    for c, (name, camera) in enumerate(zip(instrument.names, instrument.cameras, strict=True)):
        room, seen = look(camera, surfaces, paint, exposure)
        _write(folder / STRIPES / f"{name}.dark.png", develop(room, None, exposure, rng))
        for k, plane in enumerate(instrument.planes):
            if progress.cancelled:
                return instrument
            progress.report((c + k / finder.planes) / len(instrument.cameras), f"{name}, stripe {k + 1} of {finder.planes}")
            stripe = stripe_light(seen, surfaces, plane, finder.laser, exposure)
            _write(folder / STRIPES / f"{name}-{k:04d}.png", develop(room, stripe, exposure, rng))
    return instrument


def _in_range(bodies: Sequence[SolidBody], finder: RangeFinder) -> list[SolidBody]:
    T_range_world = inverse(finder.T_world_range)
    return [body.at(T_range_world @ body.T_world_body) for body in bodies]


def _new_folders(folder: Path, *names: str) -> None:
    try:
        for name in names:
            (folder / name).mkdir(parents=True)
    except FileExistsError:
        raise BadInput(f'the folder "{folder}" holds photographs already; name one that is not there yet.') from None
    except OSError as error:
        raise BadInput(f'the folder "{folder}" cannot be written: {error.strerror}.') from None


def _write_true(folder: Path, instrument: Instrument) -> None:
    write_instrument(folder / TRUE_FILE, instrument, {"made_by": "the simulator: these are the true values"})


def _write(path: Path, image: NDArray) -> None:
    if not cv2.imwrite(str(path), image, [cv2.IMWRITE_PNG_COMPRESSION, 1]):
        raise BadInput(f'the photograph "{path}" cannot be written.')
