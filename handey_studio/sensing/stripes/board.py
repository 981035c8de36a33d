"""A flat calibration board in photographs: its corners, the camera that saw them, and where the board stood."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import transform
from handey_studio.sensing.stripes.stripe_camera import StripeCamera

PATTERNS = ("chessboard", "circles")
LEAST_PHOTOGRAPHS = 3
FEW_PHOTOGRAPHS = 5  # with fewer the lens's smaller coefficients are left out: they would fit noise
WORST_PX = 1.0  # a board whose corners lie farther off than this, and than OUTLIER times the others, was misread or moved
OUTLIER = 3.0
FOCAL_DEVIATION = 0.02  # greatest relative standard deviation of the focal length that counts as known
LEAST_TILT_RAD = np.deg2rad(10.0)  # between boards: boards that face one way look alike through any lens farther off
FOCAL_SHARES = (0.2, 15.0)  # of the photograph's longer side: no lens of a stripe camera is beyond
SEARCHED_PX = 1_000_000
REFINE = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-3)


@dataclass(frozen=True)
class Board:
    """`columns` × `rows` inner corners (or circles), `square` [m] from one to the next.

    Its frame: the first corner, x along the columns, y along the rows, z into the board.
    """

    columns: int
    rows: int
    square: float
    pattern: str = "chessboard"

    def __post_init__(self) -> None:
        if not (2 <= self.columns <= 100 and 2 <= self.rows <= 100) or max(self.columns, self.rows) < 3:
            raise BadInput(f"a board of {self.columns} × {self.rows} inner corners is not usable; each way takes 2 to 100, one of them 3.")
        if not 0.0005 <= self.square <= 2.0:
            raise BadInput(f"squares of {1e3 * self.square:g} mm are not usable; they take 0.5 to 2000 mm.")
        if self.pattern not in PATTERNS:
            raise BadInput(f'pattern "{self.pattern}" is not known; choose one of: {", ".join(PATTERNS)}.')

    @property
    def corners(self) -> NDArray:
        """The corners (columns · rows, 3) [m] of its frame, row by row."""
        row, column = np.mgrid[: self.rows, : self.columns]
        return np.stack([column, row, np.zeros_like(row)], axis=-1).reshape(-1, 3) * self.square

    def holds(self, points_board: NDArray) -> NDArray:
        """Which points (n, 3) lie on the pattern, the outermost squares included."""
        cells = points_board[:, :2] / self.square
        return np.all((cells > -1.0) & (cells < (self.columns, self.rows)), axis=1)


def find_corners(grey: NDArray, board: Board, thorough: bool = True) -> NDArray | None:
    """The board's corners (n, 2) [px] in an image (H, W) of light to 255, to a fraction of a pixel, or None.

    A large image is searched at a smaller size; the corners' places are the full image's. `thorough` takes longer where there is none.
    """
    low, high = np.quantile(grey[::4, ::4], (0.01, 0.99))
    image = np.clip((grey - low) * (255.0 / max(float(high - low), 1.0)), 0, 255).astype(np.uint8)
    if board.pattern == "circles":
        found, corners = cv2.findCirclesGrid(image, (board.columns, board.rows), flags=cv2.CALIB_CB_SYMMETRIC_GRID)
        return np.asarray(corners, dtype=float).reshape(-1, 2) if found else None
    shrink = max(1, round(np.sqrt(image.size / SEARCHED_PX)))
    small = cv2.resize(image, None, fx=1 / shrink, fy=1 / shrink, interpolation=cv2.INTER_AREA) if shrink > 1 else image
    corners = _chessboard(small, (board.columns, board.rows), thorough)
    if corners is None:
        return None
    corners = np.ascontiguousarray(corners * shrink + 0.5 * (shrink - 1), dtype=np.float32).reshape(-1, 1, 2)
    window = _window(corners.reshape(board.rows, board.columns, 2))
    return np.asarray(cv2.cornerSubPix(image, corners, (window, window), (-1, -1), REFINE), dtype=float).reshape(-1, 2)


def _chessboard(image: NDArray, size: tuple[int, int], thorough: bool) -> NDArray | None:
    """Corners (n, 1, 2) by the quicker of OpenCV's two ways, then by the one that sees more."""
    quick = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    found, corners = cv2.findChessboardCorners(image, size, flags=quick)
    if not found and thorough:
        found, corners = cv2.findChessboardCornersSB(image, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    return np.asarray(corners) if found else None


def _window(corners: NDArray) -> int:
    """Half the side [px] of a window that holds one corner only."""
    steps = [np.linalg.norm(np.diff(corners, axis=axis), axis=-1).min() for axis in (0, 1)]
    return int(np.clip(0.4 * min(steps), 2, 11))


@dataclass(frozen=True, eq=False)
class CameraFit:
    """A camera at the origin of its own frame, and where the board stood.

    `Ts_camera_board` (n, 4, 4) are of the photographs used, `rms_px` (n,) how far their corners lie off. `used` (m,) tells which
    photographs these are; the others contradict them.
    """

    camera: StripeCamera
    Ts_camera_board: NDArray
    rms_px: NDArray
    used: NDArray


def fit_camera(board: Board, corners: Sequence[NDArray], size: tuple[int, int]) -> CameraFit:
    """The camera that saw a board's corners (each (n, 2) [px]) in photographs of a size (width, height), by OpenCV.

    Raises BadInput when there are too few photographs, or when they do not determine the focal length.
    """
    if len(corners) < LEAST_PHOTOGRAPHS:
        raise BadInput(f"the board was found in {len(corners)} photographs; at least {LEAST_PHOTOGRAPHS} are needed to calibrate a camera.")
    used = np.ones(len(corners), dtype=bool)
    solved = _solve(board, corners, size)
    rms = solved[3]
    good = rms <= max(WORST_PX, OUTLIER * float(np.median(rms)))
    if not good.all() and good.sum() >= LEAST_PHOTOGRAPHS:
        used = good
        solved = _solve(board, [seen for seen, keep in zip(corners, good, strict=True) if keep], size)
    camera, Ts, deviation, rms = solved
    tilt = float(np.arccos(np.clip(Ts[:, :3, 2] @ Ts[:, :3, 2].T, -1.0, 1.0)).max())
    low, high = (share * max(size) for share in FOCAL_SHARES)
    if not deviation <= FOCAL_DEVIATION * camera.focal_px or tilt < LEAST_TILT_RAD or not low < camera.focal_px < high:
        raise BadInput(
            f"the board's photographs do not determine the focal length ({camera.focal_px:.0f} px came out, boards that differ by "
            f"{np.rad2deg(tilt):.0f}° in tilt); tilt the board towards the camera and away from it, by some 30°."
        )
    return CameraFit(camera, Ts, rms, used)


def _solve(board: Board, corners: Sequence[NDArray], size: tuple[int, int]) -> tuple[StripeCamera, NDArray, float, NDArray]:
    flags = cv2.CALIB_FIX_K3 | (cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K2 if len(corners) < FEW_PHOTOGRAPHS else 0)
    objects = [board.corners.astype(np.float32)] * len(corners)
    images = [np.asarray(seen, dtype=np.float32).reshape(-1, 1, 2) for seen in corners]
    try:
        solved = cv2.calibrateCameraExtended(objects, images, size, np.eye(3), np.zeros(5), flags=flags)
    except cv2.error:
        raise BadInput("the board's corners do not fit any camera; check the number of its inner corners.") from None
    _, K, lens, turns, places, deviations, _, rms = solved
    camera = StripeCamera(
        np.eye(4),
        focal_px=float(K[0, 0]),
        width=size[0],
        height=size[1],
        aspect=float(K[1, 1] / K[0, 0]),
        centre_px=(float(K[0, 2]), float(K[1, 2])),
        distortion=tuple(np.ravel(lens)[:5].tolist()),
    )
    Ts = np.array([_pose(turn, place) for turn, place in zip(turns, places, strict=True)])
    return camera, Ts, float(np.ravel(deviations)[0]), np.ravel(rms)


def place_boards(board: Board, corners: Sequence[NDArray], camera: StripeCamera) -> CameraFit:
    """Where the board stood in photographs of a camera that is known."""
    Ts, rms, lens = [], [], np.array(camera.distortion or (0.0,) * 5)
    for seen in corners:
        _, turn, place = cv2.solvePnP(board.corners, seen, camera.matrix, lens, flags=cv2.SOLVEPNP_IPPE)
        turn, place = cv2.solvePnPRefineLM(board.corners, seen, camera.matrix, lens, turn, place)
        Ts.append(_pose(turn, place))
        missed = camera.project(board.corners @ Ts[-1][:3, :3].T + Ts[-1][:3, 3]) - seen
        rms.append(float(np.sqrt((missed**2).sum(axis=1).mean())))
    return CameraFit(camera, np.array(Ts).reshape(-1, 4, 4), np.array(rms), np.ones(len(corners), dtype=bool))


def _pose(turn: NDArray, place: NDArray) -> NDArray:
    return transform(Rotation.from_rotvec(np.ravel(turn)).as_matrix(), np.ravel(place))
