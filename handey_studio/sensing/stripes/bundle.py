"""Camera, boards and the laser's plane fitted together: the corners and the stripes of all photographs must agree with one instrument.

Corners alone leave a little of the lens free: a slight bow of all lines can hide in a board's poses. But the stripe is a straight line
where it crosses a flat board, in every photograph at nearly the same place of the lens, which is where the lens must be right.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handey_studio.geometry.transforms import transform
from handey_studio.sensing.stripes.board import Board, CameraFit
from handey_studio.sensing.stripes.stripe_camera import StripeCamera

CAMERA = 9  # numbers: focal lengths, centre, and the lens's k1, k2, p1, p2, k3
EACH = 40  # points of each stripe; nearer ones share their errors
STEP = 1e-6  # of a number's scale, for derivatives
SHARED = 3.0  # corners' deviations: a stripe's points are never better than that together, for what bends one bends its neighbours
LEAST_PX = 0.01  # photographs never agree better; exact data has no scatter to weigh by
STEPS, DAMPING, MOST_DAMPING, ENOUGH = 50, 1e-3, 1e6, 1e-7
ROUNDS = 2  # of weighing corners and stripes by how well each agree


@dataclass(frozen=True, eq=False)
class Bundle:
    """The fit, and the laser's plane (4,) in the camera's frame."""

    fit: CameraFit
    plane: NDArray


@dataclass(frozen=True, eq=False)
class _Seen:
    """What the photographs show: corners (b, n, 2) [px]; stripes' points (m, 2) [px], which way they may be off (m, 2), whose (m,)."""

    pattern: NDArray
    corners: NDArray
    stripes: NDArray
    across: NDArray
    owner: NDArray


def bundle(
    board: Board, corners: Sequence[NDArray], stripes: Sequence[NDArray | None], fit: CameraFit, plane: NDArray, keep: bool
) -> Bundle:
    """Refine camera, boards' poses and laser plane by the corners (each (n, 2)) and stripes (each (k, 2) or None) [px] of photographs.

    `keep` leaves the camera as it is; else those of its numbers that `fit` left at zero (k3) stay zero.
    """
    seen = _seen(board, corners, stripes)
    start = _packed(fit, plane)
    free = np.ones(len(start), dtype=bool)
    free[:CAMERA] = False if keep else start[:CAMERA] != 0.0
    scale = np.maximum(np.abs(start), 1e-2)
    weights = np.ones(2)
    numbers = start
    for _ in range(ROUNDS):
        missed, off = _residuals(numbers, seen, fit.camera)
        deviation = max(_deviation(missed), LEAST_PX)
        weights = 1.0 / np.array([deviation, max(_deviation(off), SHARED * deviation)])
        numbers = _fitted(numbers, free, scale, seen, fit.camera, weights)
    return _unpacked(numbers, fit, seen)


def _seen(board: Board, corners: Sequence[NDArray], stripes: Sequence[NDArray | None]) -> _Seen:
    few = [None if uv is None else uv[np.linspace(0, len(uv) - 1, EACH).round().astype(int)] for uv in stripes]
    counts = [0 if uv is None else len(uv) for uv in few]
    across = [np.tile(np.roll(np.eye(2)[int(np.argmax(np.ptp(uv, axis=0)))], 1), (len(uv), 1)) for uv in few if uv is not None]
    none = np.zeros((0, 2))
    return _Seen(
        board.corners,
        np.array(corners),
        np.concatenate([none, *(uv for uv in few if uv is not None)]),
        np.concatenate([none, *across]),
        np.repeat(np.arange(len(few)), counts),
    )


def _packed(fit: CameraFit, plane: NDArray) -> NDArray:
    """All numbers: the camera's, the plane as its normal over its distance [1/m], and each pose's rotation vector and place."""
    K, lens = fit.camera.matrix, np.zeros(5)
    lens[: len(fit.camera.distortion)] = fit.camera.distortion[:5]
    turns = Rotation.from_matrix(fit.Ts_camera_board[:, :3, :3]).as_rotvec()
    poses = np.concatenate([turns, fit.Ts_camera_board[:, :3, 3]], axis=1)
    return np.concatenate([[K[0, 0], K[1, 1], K[0, 2], K[1, 2]], lens, plane[:3] / plane[3], poses.ravel()])


def _camera(numbers: NDArray, like: StripeCamera) -> StripeCamera:
    fx, fy, cx, cy, *lens = numbers[:CAMERA].tolist()
    return replace(like, focal_px=fx, aspect=fy / fx, centre_px=(cx, cy), distortion=tuple(lens))


def _poses(numbers: NDArray) -> NDArray:
    rows = numbers[CAMERA + 3 :].reshape(-1, 6)
    turns = Rotation.from_rotvec(rows[:, :3]).as_matrix()
    return np.array([transform(turn, place) for turn, place in zip(turns, rows[:, 3:], strict=True)])


def _residuals(numbers: NDArray, seen: _Seen, like: StripeCamera) -> tuple[NDArray, NDArray]:
    """How far the corners (b, n, 2) and the stripes' points (m,) lie off [px]."""
    camera, Ts = _camera(numbers, like), _poses(numbers)
    points = np.einsum("bij,nj->bni", Ts[:, :3, :3], seen.pattern) + Ts[:, None, :3, 3]
    missed = camera.project(points.reshape(-1, 3)).reshape(seen.corners.shape) - seen.corners
    here, beside = (
        _off_plane(camera, seen.stripes + step * seen.across, Ts[seen.owner], numbers[CAMERA : CAMERA + 3]) for step in (0.0, 1.0)
    )
    return missed, here / (beside - here)


def _off_plane(camera: StripeCamera, uv: NDArray, Ts: NDArray, normal: NDArray) -> NDArray:
    """How far (m,) the points of boards (m, 4, 4) seen at pixels (m, 2) lie off the laser's plane, of its distance."""
    rays = camera.rays(uv)
    faces = Ts[:, :3, 2]
    reach = np.einsum("mi,mi->m", faces, Ts[:, :3, 3]) / np.einsum("mi,mi->m", faces, rays)
    return (rays @ normal) * reach - 1.0


def _deviation(off: NDArray) -> float:
    return 1.4826 * float(np.median(np.abs(off))) if off.size else 1.0


def _fitted(numbers: NDArray, free: NDArray, scale: NDArray, seen: _Seen, like: StripeCamera, weights: NDArray) -> NDArray:
    """The numbers that fit best, strays counting by their distance only (Levenberg and Marquardt's steps); those not `free` stay."""
    damping, cost = DAMPING, _cost(numbers, seen, like, weights)
    for _ in range(STEPS):
        off = _weighed(numbers, seen, like, weights)
        trust = 1.0 / np.sqrt(1.0 + off**2)
        slopes = _slopes(numbers, scale, seen, like, weights)[:, free]
        normal, gradient = (slopes * trust[:, None]).T @ slopes, slopes.T @ (trust * off)
        moved = numbers.copy()
        moved[free] -= scale[free] * np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
        now = _cost(moved, seen, like, weights)
        if not now < cost:
            damping *= 10.0
            if damping > MOST_DAMPING:
                break
            continue
        done = cost - now < ENOUGH * cost
        numbers, cost, damping = moved, now, 0.1 * damping
        if done:
            break
    return numbers


def _weighed(numbers: NDArray, seen: _Seen, like: StripeCamera, weights: NDArray) -> NDArray:
    missed, off = _residuals(numbers, seen, like)
    return np.concatenate([weights[0] * missed.ravel(), weights[1] * off])


def _cost(numbers: NDArray, seen: _Seen, like: StripeCamera, weights: NDArray) -> float:
    return float(np.sum(np.sqrt(1.0 + _weighed(numbers, seen, like, weights) ** 2) - 1.0))


def _slopes(numbers: NDArray, scale: NDArray, seen: _Seen, like: StripeCamera, weights: NDArray) -> NDArray:
    """The derivatives (residuals, numbers) by small steps; a pose moves its own photograph only, so all of them step at once."""
    boards, each = len(seen.corners), 2 * len(seen.pattern)
    owner = np.concatenate([np.repeat(np.arange(boards), each), seen.owner])
    slopes = np.zeros((len(owner), len(numbers)))

    def along(which: NDArray) -> NDArray:
        step = np.zeros(len(numbers))
        step[which] = STEP * scale[which]
        ahead, behind = (_weighed(numbers + sign * step, seen, like, weights) for sign in (1.0, -1.0))
        return (ahead - behind) / (2.0 * STEP)

    poses = CAMERA + 3
    for k in range(poses):
        slopes[:, k] = along(np.array([k]))
    for k in range(6):
        columns = poses + 6 * np.arange(boards) + k
        slopes[np.arange(len(owner)), columns[owner]] = along(columns)
    return slopes


def _unpacked(numbers: NDArray, fit: CameraFit, seen: _Seen) -> Bundle:
    missed, _ = _residuals(numbers, seen, fit.camera)
    normal = numbers[CAMERA : CAMERA + 3]
    length = float(np.linalg.norm(normal))
    rms = np.sqrt((missed**2).sum(axis=2).mean(axis=1))
    refined = CameraFit(_camera(numbers, fit.camera), _poses(numbers), rms, fit.used)
    return Bundle(refined, np.array([*(normal / length), 1.0 / length]))
