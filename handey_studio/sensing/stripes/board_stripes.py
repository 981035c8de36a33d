"""The laser's stripe across a flat board: where in space it falls, without what is not of its straight line."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import apply, inverse
from handey_studio.sensing.stripes.board import Board
from handey_studio.sensing.stripes.laser_planes import OUTLIER_SIGMAS, ROUNDS
from handey_studio.sensing.stripes.photographs import Photograph, read_photograph
from handey_studio.sensing.stripes.stripe_camera import StripeCamera, points_on_planes
from handey_studio.sensing.stripes.stripe_light import LaserColour, laser_light
from handey_studio.sensing.stripes.stripe_look import how_it_looks, sampled
from handey_studio.sensing.stripes.stripe_peaks import PeakOptions, StripePeaks, find_peaks

LEAST_PEAKS = 20  # on a board, for its stripe to count
STRAIGHT = 0.05  # of a square: peaks farther from the board's straight stripe are not of it
STRAIGHT_SHARE = 0.5  # of a board's peaks that must lie on it
TRIES = 200
UNEVEN = 0.2  # difference of a board's light on the two sides of a peak, of their sum, from which the peak is not trusted
EVEN_LIGHT = 5.0  # of 255: so much difference is noise in a dark room
NEAR, BESIDE = 0.75, 1.5  # stripe's widths to either side at which the board is looked at: without the laser, and beside its light


@dataclass(frozen=True, eq=False)
class LitBoard:
    """A board's photograph with the laser on, the same without (None if there is none), and where the board stood."""

    lit: Path
    dark: Path | None
    T_camera_board: NDArray


def board_stripes(
    boards: Sequence[LitBoard], board: Board, camera: StripeCamera, channel: str, options: PeakOptions
) -> tuple[LaserColour, list[NDArray | None]]:
    """The laser's colour, and where its stripe falls on each board: points (n, 3) [m] of the camera's frame, or None."""
    few = [boards[k] for k in sampled(len(boards))]
    pairs = [(read_photograph(one.lit), None if one.dark is None else read_photograph(one.dark)) for one in few]
    colour, direction = how_it_looks(pairs, channel, "auto", options)
    stripes = []
    for one in boards:
        lit, dark = read_photograph(one.lit), None if one.dark is None else read_photograph(one.dark)
        peaks = find_peaks(laser_light(lit, dark, colour), lit.saturated, direction, options)
        even = _on_even_ground(peaks, dark or lit, direction, NEAR if dark else BESIDE)
        stripes.append(on_board(peaks.uv[even], camera, one.T_camera_board, board))
    return colour, stripes


def _on_even_ground(peaks: StripePeaks, board: Photograph, direction: str, away: float) -> NDArray:
    """Which peaks (n,) have as white a board on one side as on the other, `away` widths off: along a border a stripe leans to the white."""
    white = cv2.GaussianBlur(board.light.mean(axis=2), (0, 0), 1.0)
    side = np.zeros((len(peaks.uv), 2))
    side[:, 1 if direction == "across" else 0] = away * np.median(peaks.width) + 1.0 if len(peaks.uv) else 0.0
    a, b = (_at(white, peaks.uv + sign * side) for sign in (-1, 1))
    return np.abs(a - b) <= np.maximum(UNEVEN * (a + b), EVEN_LIGHT)


def _at(image: NDArray, uv: NDArray) -> NDArray:
    u, v = np.round(uv).astype(int).T
    return image[np.clip(v, 0, image.shape[0] - 1), np.clip(u, 0, image.shape[1] - 1)]


def on_board(uv: NDArray, camera: StripeCamera, T_camera_board: NDArray, board: Board) -> NDArray | None:
    """Where a stripe's peaks lie on the board (n, 3) [m], in the camera's frame, without those off its straight line; None if too few."""
    points = points_on_board(uv, camera, T_camera_board)
    points = points[np.isfinite(points).all(axis=1)]
    on_board = apply(inverse(T_camera_board), points)
    held = board.holds(on_board)
    if held.sum() < LEAST_PEAKS:
        return None
    points, flat = points[held], on_board[held, :2]
    straight = np.flatnonzero(_straight(flat, STRAIGHT * board.square))
    if len(straight) < max(LEAST_PEAKS, STRAIGHT_SHARE * len(points)):
        return None
    return points[straight[_of_one_run(flat[straight])]]


def points_on_board(uv: NDArray, camera: StripeCamera, T_camera_board: NDArray) -> NDArray:
    """Where the rays of pixels (n, 2) meet a board's face, (n, 3) [m] in the camera's frame."""
    plane = np.array([*T_camera_board[:3, 2], T_camera_board[:3, 2] @ T_camera_board[:3, 3]])
    return points_on_planes(replace(camera, T_range_camera=np.eye(4)), uv, plane)


def _of_one_run(points: NDArray) -> NDArray:
    """Which points (n, 2), near one line, lie no farther off their own slight curve than their scatter explains."""
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    x, y = ((points - points.mean(axis=0)) @ axes.T).T
    kept = np.ones(len(points), dtype=bool)
    for _ in range(ROUNDS):
        off = np.abs(y - np.polyval(np.polyfit(x[kept], y[kept], 2), x))
        now = off <= max(OUTLIER_SIGMAS * 1.4826 * float(np.median(off[kept])), 1e-9)
        if (now == kept).all():
            break
        kept = now
    return kept


def _straight(points: NDArray, tolerance: float) -> NDArray:
    """Which points (n, 2) lie within a tolerance of the line that most of them share."""
    rng = np.random.default_rng(0)
    best = np.zeros(len(points), dtype=bool)
    for a, b in rng.integers(0, len(points), (TRIES, 2)):
        along = points[b] - points[a]
        length = np.linalg.norm(along)
        if length < 10 * tolerance:
            continue
        off = np.abs((points - points[a]) @ np.array([-along[1], along[0]])) / length
        if (off <= tolerance).sum() > best.sum():
            best = off <= tolerance
    return best
