"""Calibrating a stripe camera and its laser from photographs of a board that the stripe crosses.

Some show the board with the laser off, some with the laser on, some both ways without anything moved (`board_photographs` tells which).
`NAME.moved.png` shows the board of `NAME.png` after the rig made some steps: that gives the step.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Progress, Silent
from handey_studio.sensing.stripes.board import Board, CameraFit, fit_camera, place_boards
from handey_studio.sensing.stripes.board_photographs import (
    LASER,
    MOVED,
    BoardPhotograph,
    board_corners,
    look_at_boards,
    partner_by_name,
    partners,
)
from handey_studio.sensing.stripes.board_stripes import LitBoard, board_stripes, points_on_board
from handey_studio.sensing.stripes.bundle import bundle
from handey_studio.sensing.stripes.instrument import Instrument
from handey_studio.sensing.stripes.laser_planes import PlaneFit, distances, fit_plane
from handey_studio.sensing.stripes.photographs import read_photograph
from handey_studio.sensing.stripes.rig_frames import one_step, range_frame
from handey_studio.sensing.stripes.stripe_camera import StripeCamera, points_on_planes
from handey_studio.sensing.stripes.stripe_light import LaserColour
from handey_studio.sensing.stripes.stripe_peaks import PeakOptions

EACH = 100  # points of each board that the plane is fitted to, so that every pose counts alike
SPREAD = (10.0, 0.02)  # least extent across the stripes: times the points' rms, and of their extent along
STRAY_PX, STRAY = 1.0, 4.0  # a stripe farther off than this, and than so many times the others' median, is not the laser's on that board


@dataclass(frozen=True)
class CalibrateOptions:
    """`channel` is the laser's colour; `table` names the board's photograph whose plane is the range frame's z = 0, else the first.

    `steps` is how many of the rig's steps lie between `NAME` and `NAME.moved`; `step_m` is a step's length [m] where that is known better
    than two photographs can tell: these then give its direction only.
    """

    channel: str = "auto"
    table: str | None = None
    steps: int = 1
    step_m: float | None = None
    peaks: PeakOptions = field(default_factory=PeakOptions)


@dataclass(frozen=True, eq=False)
class Calibration:
    """The instrument, and how well the photographs agree with it.

    `camera_rms_px` by photograph's name; `stripe_rms` [m] how far each board's stripe lies off the laser's plane, `plane_rms` over all.
    `board_rms` [m] is how far each stripe, triangulated with the plane through the other boards' stripes, lies in front of or behind its
    board, and `board_per_px` [m] what a pixel's error of the stripe makes there: an instrument's precision and its geometry's.
    `spread` [m] is the extent of the stripes' points across their main direction, `tilt_deviation` [rad] what the plane may turn by.
    `left_out` tells why photographs were not used.
    """

    instrument: Instrument
    camera_rms_px: dict[str, float]
    stripe_rms: dict[str, float]
    plane_rms: float
    board_rms: dict[str, float]
    board_per_px: float
    spread: float
    tilt_deviation: float
    table: str
    left_out: dict[str, str]
    colour: LaserColour


def calibrate(
    folders: Path | Sequence[Path],
    board: Board,
    camera: StripeCamera | None = None,
    options: CalibrateOptions = CalibrateOptions(),
    progress: Progress = Silent(),
) -> Calibration:
    """Camera and laser plane from a folder of board photographs, or several; a `camera` that is known is kept.

    Raises BadInput with one sentence when the photographs do not determine them, and says what would.
    """
    left_out: dict[str, str] = {}
    photographs = look_at_boards([folders] if isinstance(folders, Path) else folders, board, left_out, progress)
    lasers = partners(photographs)
    photographs = [one for one in photographs if one.path not in lasers.values()]
    left_out |= {one.name: "the board was not found" for one in photographs if one.corners is None}
    found = [one for one in photographs if one.corners is not None]
    corners = [one.corners for one in found if one.corners is not None]
    fit = place_boards(board, corners, camera) if camera is not None else fit_camera(board, corners, found[0].size)
    left_out |= {one.name: "its corners contradict the other photographs" for one, used in zip(found, fit.used, strict=True) if not used}
    found = [one for one, used in zip(found, fit.used, strict=True) if used]
    colour, stripes = _stripes(found, lasers, board, fit, options, left_out)
    fit, plane = _together(board, found, stripes, fit, camera is not None, left_out)
    return _calibration(fit, plane, found, stripes, board, options, left_out, colour)


def _stripes(
    found: Sequence[BoardPhotograph],
    lasers: dict[str, Path],
    board: Board,
    fit: CameraFit,
    options: CalibrateOptions,
    left_out: dict[str, str],
) -> tuple[LaserColour, dict[str, NDArray]]:
    """The laser's colour, and by photograph's name the stripe on its board, (k, 2) [px]."""
    lit = {
        one.name: LitBoard(lasers.get(one.name, one.path), one.path if lasers else None, T)
        for one, T in zip(found, fit.Ts_camera_board, strict=True)
        if not lasers or one.name in lasers
    }
    if not lit:
        raise BadInput(f"none of the photographs in which the board was found has a partner NAME.{LASER}.png with the laser on.")
    colour, points = board_stripes(list(lit.values()), board, fit.camera, options.channel, options.peaks)
    left_out |= {
        f"{name}, its stripe": "no straight stripe was found on the board" for name, one in zip(lit, points, strict=True) if one is None
    }
    return colour, {name: fit.camera.project(one) for name, one in zip(lit, points, strict=True) if one is not None}


def _together(
    board: Board,
    found: Sequence[BoardPhotograph],
    stripes: dict[str, NDArray],
    fit: CameraFit,
    keep: bool,
    left_out: dict[str, str],
) -> tuple[CameraFit, NDArray]:
    """Camera, poses and the laser's plane (4,) that agree best; takes the stripes out that contradict the others."""
    names, corners = [one.name for one in found], [one.corners for one in found if one.corners is not None]
    start = laser_plane(list(_points(fit, names, stripes).values())).plane
    refined = bundle(board, corners, [stripes.get(name) for name in names], fit, start, keep)
    off = _off_boards(refined.fit, names, stripes)
    limit = max(STRAY_PX, STRAY * float(np.median([rms / per_px for rms, per_px in off.values()]))) if off else np.inf
    strays = [name for name, (rms, per_px) in off.items() if rms > limit * per_px]
    for name in strays:
        del stripes[name]
        left_out[f"{name}, its stripe"] = "it contradicts the other boards' stripes"
    if strays:
        start = laser_plane(list(_points(fit, names, stripes).values())).plane
        refined = bundle(board, corners, [stripes.get(name) for name in names], fit, start, keep)
    return refined.fit, refined.plane


def _points(fit: CameraFit, names: Sequence[str], stripes: dict[str, NDArray]) -> dict[str, NDArray]:
    """Where the stripes fall on their boards: points (k, 3) [m] of the camera's frame, by photograph's name."""
    poses = dict(zip(names, fit.Ts_camera_board, strict=True))
    return {name: points_on_board(uv, fit.camera, poses[name]) for name, uv in stripes.items()}


def _off_boards(fit: CameraFit, names: Sequence[str], stripes: dict[str, NDArray]) -> dict[str, tuple[float, float]]:
    """Each stripe's rms distance [m] off its board by the plane through the other boards' stripes, and what a pixel makes there [m]."""
    points, poses = _points(fit, names, stripes), dict(zip(names, fit.Ts_camera_board, strict=True))
    camera, off = replace(fit.camera, T_range_camera=np.eye(4)), {}
    for name, uv in stripes.items():
        others = [one for other, one in points.items() if other != name]
        if len(others) < 2 or not _determined(plane := _fit_stripes(others)):
            continue
        across = np.eye(2)[int(np.argmin(np.ptp(uv, axis=0)))]
        away, nudged = (
            (points_on_planes(camera, uv + step * across, plane.plane) - poses[name][:3, 3]) @ poses[name][:3, 2] for step in (0.0, 1.0)
        )
        off[name] = (float(np.sqrt(np.nanmean(away**2))), float(np.nanmedian(np.abs(nudged - away))))
    return off


def _calibration(
    fit: CameraFit,
    plane: NDArray,
    found: Sequence[BoardPhotograph],
    stripes: dict[str, NDArray],
    board: Board,
    options: CalibrateOptions,
    left_out: dict[str, str],
    colour: LaserColour,
) -> Calibration:
    names = [one.name for one in found]
    points, off = _points(fit, names, stripes), _off_boards(fit, names, stripes)
    spread = laser_plane(list(points.values())).extents[1]
    rms = {name: float(np.sqrt(np.mean(distances(plane, one) ** 2))) for name, one in points.items()}
    plane_rms = float(np.sqrt(np.mean(np.square(list(rms.values())))))
    table = _table(names, options)
    T_range_camera = range_frame(fit.Ts_camera_board[names.index(table)], board)
    normal = T_range_camera[:3, :3] @ plane[:3]
    in_range = np.array([*normal, plane[3] + normal @ T_range_camera[:3, 3]])
    step = _rig_step(found, board, fit, T_range_camera, options)
    return Calibration(
        instrument=Instrument((replace(fit.camera, T_range_camera=T_range_camera),), ("",), in_range[None], rig_step=step),
        camera_rms_px=dict(zip(names, fit.rms_px.tolist(), strict=True)),
        stripe_rms=rms,
        plane_rms=plane_rms,
        board_rms={name: one for name, (one, _) in off.items()},
        board_per_px=float(np.median([per_px for _, per_px in off.values()])) if off else 0.0,
        spread=float(spread),
        tilt_deviation=plane_rms / float(spread) / np.sqrt(len(stripes)),
        table=table,
        left_out=left_out,
        colour=colour,
    )


def laser_plane(stripes: Sequence[NDArray]) -> PlaneFit:
    """The laser's plane through its stripes on boards, each (n, 3) [m]. Raises BadInput when they do not determine it."""
    if len(stripes) < 2:
        raise BadInput(f"a straight stripe was found on the board in {len(stripes)} photographs; at least 2 poses of the board are needed.")
    plane = _fit_stripes(stripes)
    if not _determined(plane):
        raise BadInput(
            f"the stripes on the {len(stripes)} boards lie along one line (they spread {1e3 * plane.extents[1]:.2f} mm across it), "
            "so the laser's plane may turn about it; move the board towards the camera, or tilt it the other way."
        )
    return plane


def _fit_stripes(stripes: Sequence[NDArray]) -> PlaneFit:
    return fit_plane(np.concatenate([points[np.linspace(0, len(points) - 1, EACH).round().astype(int)] for points in stripes]))


def _determined(plane: PlaneFit) -> bool:
    return bool(plane.extents[1] >= max(SPREAD[0] * plane.rms, SPREAD[1] * plane.extents[0]))


def _table(names: list[str], options: CalibrateOptions) -> str:
    if options.table is None:
        return names[0]
    if options.table not in names:
        raise BadInput(f'the board was not found in a photograph "{options.table}"; choose one of: {", ".join(names[:20])}.')
    return options.table


def _rig_step(
    found: Sequence[BoardPhotograph], board: Board, fit: CameraFit, T_range_camera: NDArray, options: CalibrateOptions
) -> NDArray | None:
    """T_range_rig of one step, from the photographs of boards that stayed while the rig moved; None without such."""
    for one, before in zip(found, fit.Ts_camera_board, strict=True):
        moved = partner_by_name(one.path, MOVED)
        if moved is None:
            continue
        corners = board_corners(read_photograph(moved), board)
        if corners is None:
            raise BadInput(f'the board was not found in "{moved}".')
        after = place_boards(board, [corners], fit.camera).Ts_camera_board[0]
        return one_step(before, after, board, T_range_camera, options.steps, options.step_m)
    return None
