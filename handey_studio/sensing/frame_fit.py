"""The range finder's frame from many poses of the cube, by least squares: with residuals, what is not determined, and outliers told.

Extends Handey 1987 §6, which takes three poses and looks at no residual. Unknown are the turn of the range frame (about the vertical
alone, as in §6, or freely), where it lies, and where the face lies in the hand.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.geometry.transforms import apply, rotation_about, transform
from handey_studio.sensing.range_calibration import UP, Shown, TablePoint, rigid_between, upright_between

STEPS, STILL = 30, 1e-12
LEVER_M = 0.1  # a turn counts by how far it moves what is so far away: then turns and lengths are alike
KNOWN_SHARE = 5e-3  # a combination of unknowns that the poses tell less of, against the best known one, is left as it is
NAMED = 0.05  # such a combination speaks of an unknown that has this share in it
PRIOR_READINGS = 4  # as so many readings counts what is expected of a face's error, beside the residuals
CHANCE = 0.01  # at which a pose in a faultless set is called an outlier
KEPT_SHARE = 0.75
DISAGREE = 3.0  # times what is expected
LEANS = 4.0  # sigmas


@dataclass(frozen=True)
class FitOptions:
    """`upright`: the z axes are parallel (§6). `face_sigma_m` is what a face's middle is expected to be off in each coordinate; outliers
    are at least `outlier_m` off what the other poses say. Warnings are given beyond `most_mm` and `most_deg` (one sigma)."""

    upright: bool = True
    face_sigma_m: float = 1.5e-4
    outlier_m: float = 5e-4
    most_mm: float = 0.3
    most_deg: float = 0.1


@dataclass(frozen=True, eq=False)
class FrameFit(Value):
    """A frame that was fitted. `T_world_range` (4, 4); `face_hand` (3,) [m] where the cube's face is in the hand.

    `residuals_m` (n, 3) of every pose, in the world: range finder minus arm; `used` (n,) is False for outliers, which had no say.
    `sigma_m` (3,) along x, y, z of the world, at the middle `middle_range` (3,) of the faces; `sigma_rad` (3,) about x, y, z, zero where
    the turn is taken to be known. An infinite sigma says that the poses do not determine it. `warnings` are sentences.
    """

    T_world_range: NDArray
    face_hand: NDArray
    residuals_m: NDArray
    used: NDArray
    sigma_m: NDArray
    sigma_rad: NDArray
    middle_range: NDArray
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for key in ("T_world_range", "face_hand", "residuals_m", "sigma_m", "sigma_rad", "middle_range"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))
        object.__setattr__(self, "used", frozen_array(self.used, bool))

    @property
    def rms_m(self) -> float:
        """Root mean square [m] of the lengths of the used poses' residuals."""
        return float(np.sqrt((self.residuals_m[self.used] ** 2).sum(axis=1).mean()))

    @property
    def tilt_rad(self) -> float:
        """Angle [rad] between the z axes of the range finder and of the world."""
        return float(np.arctan2(np.linalg.norm(self.T_world_range[:2, 2]), self.T_world_range[2, 2]))


class Solved(NamedTuple):
    """One least-squares answer: the frame, the face in the hand (3,), the sum of squares [m²], what is left to check it by, and the
    Jacobian's singular values and right vectors, of unknowns in the order turns (× `LEVER_M`), middle, face."""

    T_world_range: NDArray
    face: NDArray
    squares: float
    freedom: int
    sizes: NDArray
    vectors: NDArray


def fit_frame(shown: Sequence[Shown], table: TablePoint | None, options: FitOptions = FitOptions()) -> FrameFit:
    """The frame that fits the poses best. Poses that contradict the others are outliers: told, and left out.

    Without `table` the frame's height is determined only if the hand was tilted between poses. Raises BadInput for fewer than 2 poses.
    """
    if len(shown) < 2:
        raise BadInput(f"the cube was shown at {len(shown)} poses; a frame takes at least 2, and 3 to be determined.")
    used = np.ones(len(shown), dtype=bool)
    while (worst := _outlier(shown, used, table, options)) is not None:
        used[worst] = False
    solved = _solve(_picked(shown, used), table, options)
    residuals = np.array([_residual(solved, one) for one in shown])
    sigma_rad, sigma_m = _sigmas(solved, options)
    middle = np.mean([one.face_range for one in _picked(shown, used)], axis=0)
    fit = FrameFit(solved.T_world_range, solved.face, residuals, used, sigma_m, sigma_rad, middle)
    return replace(fit, warnings=_warnings(fit, shown, table, options))


def _picked(shown: Sequence[Shown], used: NDArray) -> list[Shown]:
    return [one for one, use in zip(shown, used, strict=True) if use]


def _residual(solved: Solved, one: Shown) -> NDArray:
    return apply(solved.T_world_range, one.face_range) - apply(one.T_world_hand, solved.face)


def _solve(shown: Sequence[Shown], table: TablePoint | None, options: FitOptions) -> Solved:
    """Gauss–Newton from the upright answer; a free turn also from the one that takes the face to be in the middle of the hand."""
    starts = [upright_between(shown)]
    if options.upright:
        return _descend(shown, table, starts[0], UP[None])
    starts.append(rigid_between(np.array([one.T_world_hand[:3, 3] for one in shown]), np.array([one.face_range for one in shown])))
    return min((_descend(shown, table, start, np.eye(3)) for start in starts), key=lambda solved: solved.squares)


def _descend(shown: Sequence[Shown], table: TablePoint | None, start: NDArray, axes: NDArray) -> Solved:
    """Least squares from a start (4, 4), turning about the given axes (k, 3) of the world."""
    faces, hands = np.array([one.face_range for one in shown]), np.array([one.T_world_hand for one in shown])
    middle, k = faces.mean(axis=0), len(axes)
    R, c = start[:3, :3], apply(start, middle)
    f = np.einsum("nji,nj->ni", hands[:, :3, :3], (faces - middle) @ R.T + c - hands[:, :3, 3]).mean(axis=0)
    J, off = np.empty((0, k + 6)), np.empty(0)
    for _ in range(STEPS):
        arms = (faces - middle) @ R.T
        off = (arms + c - hands[:, :3, 3] - hands[:, :3, :3] @ f).ravel()
        turns = np.cross(axes[:, None], arms[None]).reshape(k, -1).T / LEVER_M
        J = np.concatenate([turns, np.tile(np.eye(3), (len(faces), 1)), -hands[:, :3, :3].reshape(-1, 3)], axis=1)
        if table is not None:
            arm = R @ (table.point_range - middle)
            off = np.append(off, arm[2] + c[2] - table.height_world)
            J = np.concatenate([J, [np.r_[np.cross(axes, arm)[:, 2] / LEVER_M, UP, 0.0, 0.0, 0.0]]])
        step = np.linalg.lstsq(J, -off, rcond=KNOWN_SHARE)[0]
        turn = step[:k] @ axes / LEVER_M
        angle = float(np.linalg.norm(turn))
        R = rotation_about(turn, angle) @ R if angle > 0 else R
        c, f = c + step[k : k + 3], f + step[k + 3 :]
        if np.abs(step).max() < STILL:
            break
    _, sizes, vectors = np.linalg.svd(J, full_matrices=True)
    sizes = np.append(sizes, np.zeros(len(vectors) - len(sizes)))
    known = int((sizes > KNOWN_SHARE * sizes[0]).sum())
    return Solved(transform(R, c - R @ middle), f, float(off @ off), len(off) - known, sizes, vectors)


def _sigmas(solved: Solved, options: FitOptions) -> tuple[NDArray, NDArray]:
    """One sigma of the turns (3,) [rad] and of the middle's place (3,) [m]; infinite where the poses do not tell."""
    variance = (solved.squares + PRIOR_READINGS * options.face_sigma_m**2) / (solved.freedom + PRIOR_READINGS)
    known = solved.sizes > KNOWN_SHARE * solved.sizes[0]
    spread = (solved.vectors[known] / solved.sizes[known, None]) ** 2
    sigma = np.sqrt(variance * spread.sum(axis=0))
    sigma[(np.abs(solved.vectors[~known]) > NAMED).any(axis=0)] = np.inf
    turns = sigma[:-6] / LEVER_M
    return (np.array([0.0, 0.0, turns[0]]) if options.upright else turns), sigma[-6:-3]


def _outlier(shown: Sequence[Shown], used: NDArray, table: TablePoint | None, options: FitOptions) -> int | None:
    """The pose without which the rest agrees so much better that chance does not explain it; None if there is none.

    An F test on the three residuals that go, at a chance shared among the poses; no more than a quarter of them may go.
    """
    numbers = [k for k in range(len(used)) if used[k]]
    if len(numbers) - 1 < KEPT_SHARE * len(used):
        return None
    whole = _solve(_picked(shown, used), table, options)
    expected = PRIOR_READINGS * (0.1 * options.face_sigma_m) ** 2  # keeps data without noise from dividing by zero
    best, ratio = None, 0.0
    for number in numbers:
        without = used.copy()
        without[number] = False
        rest = _solve(_picked(shown, without), table, options)
        freedom, less = rest.freedom, whole.freedom - rest.freedom
        if freedom < 1 or less < 1 or np.linalg.norm(_residual(rest, shown[number])) < options.outlier_m:
            continue
        f = (whole.squares - rest.squares) / less / ((rest.squares + expected) / freedom)
        if f > f_distribution.isf(CHANCE / len(numbers), less, freedom) and f > ratio:
            best, ratio = number, f
    return best


def _warnings(fit: FrameFit, shown: Sequence[Shown], table: TablePoint | None, options: FitOptions) -> tuple[str, ...]:
    """What a person should know before they trust the frame."""
    told = [_told_outlier(fit, k) for k in range(len(shown)) if not fit.used[k]]
    kept = _picked(shown, fit.used)
    if len(kept) < 4:
        told.append(f"{len(kept)} poses leave hardly anything over to check the answer by; show the cube at 4 or more.")
    expected = np.sqrt(3.0) * options.face_sigma_m
    if fit.rms_m > DISAGREE * expected:
        told.append(f"the poses disagree by {1e3 * fit.rms_m:.2f} mm (rms), {1e3 * expected:.2f} mm is expected: the range finder's z may "
                    "not be parallel to the robot's, the arm may not be where its joints say, or the cube may have slipped.")  # fmt: skip
    return tuple(told) + _undetermined(fit, np.array([one.T_world_hand for one in kept]), table, options)


def _undetermined(fit: FrameFit, hands: NDArray, table: TablePoint | None, options: FitOptions) -> tuple[str, ...]:
    """What the poses (n, 4, 4) leave open, by the error that is expected of a face, and what would close it."""
    told, share = [], min(1.0, np.sqrt(3.0) * options.face_sigma_m / max(fit.rms_m, 1e-12))
    across, height = (1e3 * share * float(sigma) for sigma in (fit.sigma_m[:2].max(), fit.sigma_m[2]))
    turns = np.rad2deg(share * fit.sigma_rad)
    spread = 1e3 * float(np.linalg.norm(hands[:, :3, 3] - hands[:, :3, 3].mean(axis=0), axis=1).max())
    if turns[2] > options.most_deg:
        told.append(f"the turn about the vertical {_within(turns[2], '°')}, {options.most_deg}° is wanted: the places lie within "
                    f"{spread:.0f} mm of their middle; show the cube at places farther apart.")  # fmt: skip
    if across > options.most_mm:
        told.append(f"the offset {_within(across, ' mm')}, {options.most_mm} mm is wanted: the hand turned by at most "
                    f"{_most_turned(hands):.0f}°; turn it by 180°, else it stays mixed with where the face is in the hand.")  # fmt: skip
    if height > options.most_mm:
        told.append(f"the height {_within(height, ' mm')}: {'measure the table' if table is None else 'tilt the hand between poses'}.")
    if turns[:2].max() > options.most_deg:
        sizes = 1e3 * np.linalg.svd(hands[:, :3, 3] - hands[:, :3, 3].mean(axis=0), compute_uv=False) / np.sqrt(len(hands))
        told.append(f"the tilt {_within(turns[:2].max(), '°')}: the places lie nearly on one line (rms {sizes[0]:.0f} mm along, "
                    f"{sizes[1]:.0f} mm across); spread them over the table.")  # fmt: skip
    elif np.rad2deg(fit.tilt_rad) > max(options.most_deg, LEANS * np.rad2deg(fit.sigma_rad[:2].max())) and not options.upright:
        told.append(f"the range finder's z is {np.rad2deg(fit.tilt_rad):.2f}° off the robot's, where §6 takes them for parallel; level it.")
    return tuple(told)


def _told_outlier(fit: FrameFit, k: int) -> str:
    off = 1e3 * float(np.linalg.norm(fit.residuals_m[k]))
    return f"pose {k + 1} is {off:.1f} mm off what the others say and was left out; look whether the cube slipped or was half hidden."


def _within(sigma: float, unit: str) -> str:
    return f"is known to ± {sigma:.2g}{unit} only" if np.isfinite(sigma) else "is not determined"


def _most_turned(hands: NDArray) -> float:
    """Greatest angle [°] between two orientations (n, 4, 4) of the hand."""
    traces = np.einsum("aij,bij->ab", hands[:, :3, :3], hands[:, :3, :3])
    return float(np.rad2deg(np.arccos(np.clip((traces.min() - 1.0) / 2.0, -1.0, 1.0))))
