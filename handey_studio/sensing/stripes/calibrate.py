"""Calibrating a stripe camera and its laser from photographs of a board that the stripe crosses.

The folder's convention: `NAME.png` shows the board, `NAME.laser.png` the same with the laser on and nothing moved. Where no photograph
has a partner, the stripe is looked for in the board's photographs themselves. `NAME.moved.png` shows the board of `NAME.png`
after the rig made some steps: that gives the step.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, logm

from handey_studio.base import BadInput, Progress, Silent
from handey_studio.geometry.transforms import apply, inverse, rotation_angle, transform
from handey_studio.sensing.stripes.board import Board, CameraFit, find_corners, fit_camera, place_boards
from handey_studio.sensing.stripes.board_stripes import LitBoard, board_stripes
from handey_studio.sensing.stripes.instrument import Instrument
from handey_studio.sensing.stripes.laser_planes import PlaneFit, distances, fit_plane
from handey_studio.sensing.stripes.photographs import SUFFIXES, Photograph, list_photographs, read_photograph
from handey_studio.sensing.stripes.stripe_camera import StripeCamera
from handey_studio.sensing.stripes.stripe_light import LaserColour
from handey_studio.sensing.stripes.stripe_peaks import PeakOptions

LASER, MOVED = "laser", "moved"
EACH = 100  # points of each board that the plane is fitted to, so that every pose counts alike
SPREAD = (10.0, 0.02)  # least extent across the stripes: times the points' rms, and of their extent along
LEAST_STEP_M = 1e-6
PURE_SHIFT_RAD = np.deg2rad(0.5)  # a rig that turns by less between two photographs only shifts


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

    `camera_rms_px` by photograph's name; `stripe_rms` [m] how far each board's stripe lies off the laser's plane, `plane_rms` over all;
    `spread` [m] is the extent of the stripes' points across their main direction, `tilt_deviation` [rad] what the plane may turn by.
    `left_out` tells why photographs were not used.
    """

    instrument: Instrument
    camera_rms_px: dict[str, float]
    stripe_rms: dict[str, float]
    plane_rms: float
    spread: float
    tilt_deviation: float
    table: str
    left_out: dict[str, str]
    colour: LaserColour


@dataclass(frozen=True, eq=False)
class _Boards:
    """Photographs in which the board was found: their names, files and corners."""

    names: list[str]
    paths: list[Path]
    corners: list[NDArray]
    size: tuple[int, int]


def calibrate(
    folder: Path,
    board: Board,
    camera: StripeCamera | None = None,
    options: CalibrateOptions = CalibrateOptions(),
    progress: Progress = Silent(),
) -> Calibration:
    """Camera and laser plane from a folder of board photographs; a `camera` that is known is kept.

    Raises BadInput with one sentence when the photographs do not determine them, and says what would.
    """
    left_out: dict[str, str] = {}
    paths = [path for path in list_photographs(folder) if not path.stem.endswith((f".{LASER}", f".{MOVED}"))]
    lasers = {path.stem: partner for path in paths if (partner := _partner(path, LASER)) is not None}
    boards = _find_boards(paths, board, left_out, progress)
    fit = place_boards(board, boards.corners, camera) if camera is not None else fit_camera(board, boards.corners, boards.size)
    for name, used in zip(boards.names, fit.used, strict=True):
        if not used:
            left_out[name] = "its corners contradict the other photographs"
    names = [name for name, used in zip(boards.names, fit.used, strict=True) if used]
    files = [path for path, used in zip(boards.paths, fit.used, strict=True) if used]
    lit = {
        path.stem: LitBoard(lasers.get(path.stem, path), path if lasers else None, T)
        for path, T in zip(files, fit.Ts_camera_board, strict=True)
    }
    lit = {name: one for name, one in lit.items() if not lasers or name in lasers}
    if not lit:
        raise BadInput(f"none of the photographs in which the board was found has a partner NAME.{LASER}.png with the laser on.")
    colour, found = board_stripes(list(lit.values()), board, fit.camera, options.channel, options.peaks)
    stripes = {name: points for name, points in zip(lit, found, strict=True) if points is not None}
    left_out |= {f"{name}, its stripe": "no straight stripe was found on the board" for name in lit if name not in stripes}
    return _calibration(fit, names, stripes, board, boards, options, left_out, colour)


def _partner(path: Path, kind: str) -> Path | None:
    return next((one for suffix in SUFFIXES if (one := path.with_name(f"{path.stem}.{kind}{suffix}")).is_file()), None)


def _find_boards(paths: Sequence[Path], board: Board, left_out: dict[str, str], progress: Progress) -> _Boards:
    found = _Boards([], [], [], (0, 0))
    for k, path in enumerate(paths):
        if progress.cancelled:
            break
        progress.report(k / len(paths), f"looking for the board in {path.name}")
        photograph = read_photograph(path)
        if found.names and photograph.size != found.size:
            raise BadInput(f'photograph "{path}" is {photograph.size} px and others are {found.size} px; one camera has one size.')
        corners = _corners(photograph, board)
        if corners is None:
            left_out[path.stem] = "the board was not found"
            continue
        found = _Boards([*found.names, path.stem], [*found.paths, path], [*found.corners, corners], photograph.size)
    if not found.names:
        raise BadInput(
            f"no photograph of {len(paths)} shows a {board.pattern} of {board.columns} × {board.rows} inner corners "
            "(a board of 10 × 7 squares has 9 × 6)."
        )
    return found


def _corners(photograph: Photograph, board: Board) -> NDArray | None:
    """The board in a photograph: in all its light, else in the colour in which a laser across it may be dark."""
    corners = find_corners(photograph.light.mean(axis=2), board)
    if corners is not None:
        return corners
    singles = (find_corners(photograph.light[..., channel], board, thorough=False) for channel in (0, 2, 1))
    return next((corners for corners in singles if corners is not None), None)


def _calibration(
    fit: CameraFit,
    names: list[str],
    stripes: dict[str, NDArray],
    board: Board,
    boards: _Boards,
    options: CalibrateOptions,
    left_out: dict[str, str],
    colour: LaserColour,
) -> Calibration:
    plane = laser_plane(list(stripes.values()))
    table = _table(names, options)
    T_range_camera = range_frame(fit.Ts_camera_board[names.index(table)], board)
    normal = T_range_camera[:3, :3] @ plane.plane[:3]
    in_range = np.array([*normal, plane.plane[3] + normal @ T_range_camera[:3, 3]])
    camera = replace(fit.camera, T_range_camera=T_range_camera)
    step = _rig_step(boards, board, fit, names, T_range_camera, options)
    rms = {name: float(np.sqrt(np.mean(distances(plane.plane, points) ** 2))) for name, points in stripes.items()}
    return Calibration(
        instrument=Instrument((camera,), ("",), in_range[None], rig_step=step),
        camera_rms_px=dict(zip(names, fit.rms_px.tolist(), strict=True)),
        stripe_rms=rms,
        plane_rms=plane.rms,
        spread=float(plane.extents[1]),
        tilt_deviation=plane.rms / float(plane.extents[1]) / np.sqrt(len(stripes)),
        table=table,
        left_out=left_out,
        colour=colour,
    )


def laser_plane(stripes: Sequence[NDArray]) -> PlaneFit:
    """The laser's plane through its stripes on boards, each (n, 3) [m]. Raises BadInput when they do not determine it."""
    if len(stripes) < 2:
        raise BadInput(f"a straight stripe was found on the board in {len(stripes)} photographs; at least 2 poses of the board are needed.")
    plane = fit_plane(np.concatenate([_thinned(points) for points in stripes]))
    if not plane.extents[1] >= max(SPREAD[0] * plane.rms, SPREAD[1] * plane.extents[0]):
        raise BadInput(
            f"the stripes on the {len(stripes)} boards lie along one line (they spread {1e3 * plane.extents[1]:.2f} mm across it), "
            "so the laser's plane may turn about it; move the board towards the camera, or tilt it the other way."
        )
    return plane


def _thinned(points: NDArray) -> NDArray:
    return points[np.linspace(0, len(points) - 1, EACH).round().astype(int)]


def _table(names: list[str], options: CalibrateOptions) -> str:
    if options.table is None:
        return names[0]
    if options.table not in names:
        raise BadInput(f'the board was not found in a photograph "{options.table}"; choose one of: {", ".join(names[:20])}.')
    return options.table


def range_frame(T_camera_board: NDArray, board: Board) -> NDArray:
    """T_range_camera for the range frame on a board: origin in its middle, z out of it, x as near to the photograph's rows as can be.

    The board's own corners could be counted from either end, so its axes are not used.
    """
    origin = apply(T_camera_board, board.corners.mean(axis=0))
    up = T_camera_board[:3, 2] * (-1.0 if T_camera_board[:3, 2] @ origin > 0 else 1.0)
    x = np.array([1.0, 0.0, 0.0]) - up[0] * up
    x /= np.linalg.norm(x)
    return inverse(transform(np.stack([x, np.cross(up, x), up], axis=1), origin))


def _rig_step(
    boards: _Boards, board: Board, fit: CameraFit, names: list[str], T_range_camera: NDArray, options: CalibrateOptions
) -> NDArray | None:
    """T_range_rig of one step, from the photographs of boards that stayed while the rig moved; None without such."""
    poses = dict(zip(names, fit.Ts_camera_board, strict=True))
    for path in boards.paths:
        moved = _partner(path, MOVED)
        if moved is None or path.stem not in poses:
            continue
        corners = _corners(read_photograph(moved), board)
        if corners is None:
            raise BadInput(f'the board was not found in "{moved}".')
        after = place_boards(board, [corners], fit.camera).Ts_camera_board[0]
        return one_step(poses[path.stem], after, board, T_range_camera, options)
    return None


def one_step(before: NDArray, after: NDArray, board: Board, T_range_camera: NDArray, options: CalibrateOptions) -> NDArray:
    """The rig's step from a resting board's poses before the camera, before and after some steps."""
    T_before_after = before @ inverse(after)
    if rotation_angle(T_before_after[:3, :3]) < PURE_SHIFT_RAD:
        middle = board.corners.mean(axis=0)
        shift = apply(before, middle) - apply(after, middle)
        length = np.linalg.norm(shift) / options.steps
        if not length > LEAST_STEP_M:
            raise BadInput(
                f"the board moved by {1e3 * length * options.steps:.3f} mm only before the camera, so the rig's step is not known."
            )
        return transform(
            None, T_range_camera[:3, :3] @ shift / options.steps * (1.0 if options.step_m is None else options.step_m / length)
        )
    T_range = T_range_camera @ T_before_after @ inverse(T_range_camera)
    step = np.real(expm(np.asarray(logm(T_range)) / options.steps))
    u, _, vh = np.linalg.svd(step[:3, :3])
    return transform(u @ vh, step[:3, 3])
