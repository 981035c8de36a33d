"""The upper face of the calibration cube in a depth map (Handey 1987 §6): its plane, and its middle to a fraction of a cell."""

from dataclasses import dataclass
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handey_studio.base import Value, frozen_array
from handey_studio.sensing.depth_map import DepthMap

SMOOTH_SIGMAS, SMOOTHEST_M = 6.0, 0.001  # neighbours that differ by no more are of one surface
ON_SIGMAS, NEAREST_M = 5.0, 0.001  # readings so near to the face's plane are on it
RIM_CELLS = 2  # the rim's cells have neighbours that are not of the face
FITS, NEAR_CELLS = 8, (3.0, 1.2)  # rounds of the outline's fit; rim cells farther off a side are hidden by something: at first, at last
SIZE_CELLS = 1.5  # by which a side may differ from the cube's
RIM_SHARE, SIDE_SHARE = 0.75, 0.4  # of all rim cells, and of a side's length, that must lie on the outline
LEVEL_RAD = np.deg2rad(10.0)


@dataclass(frozen=True, eq=False)
class CubeFace(Value):
    """The cube's upper face, or why it was not found.

    `middle_range` (3,) [m] is the middle of the square outline, on its plane; `normal_range` (3,) points up; `rms_m` is how far readings
    are off it, `area_m2` what they cover.
    """

    found: bool
    reason: str
    middle_range: NDArray
    normal_range: NDArray
    rms_m: float = 0.0
    area_m2: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "middle_range", frozen_array(self.middle_range))
        object.__setattr__(self, "normal_range", frozen_array(self.normal_range))


def find_cube_face(depth_map: DepthMap, side: float) -> CubeFace:
    """The highest level square of a side [m] in a depth map that is whole: nothing hides a part of it, and it does not leave the map."""
    surfaces = _surfaces(depth_map, side)
    if not surfaces:
        return _none(f"no level surface of about {1e3 * side:.0f} × {1e3 * side:.0f} mm is in view")
    faces = [_face(depth_map, cells, side) for cells in surfaces]
    found = [face for face in faces if face.found]
    return max(found, key=lambda face: face.middle_range[2]) if found else max(faces, key=lambda face: face.area_m2)


def _surfaces(depth_map: DepthMap, side: float) -> list[NDArray]:
    """Masks (ny, nx) of connected surfaces that are not far from the face's size."""
    z, most = depth_map.elevation, max(SMOOTH_SIGMAS * depth_map.noise, SMOOTHEST_M)
    smooth = np.isfinite(z)
    for axis in (0, 1):
        for shift in (-1, 1):
            with np.errstate(invalid="ignore"):
                smooth &= np.abs(z - np.roll(z, shift, axis=axis)) <= most
    labels, count = cast(tuple[NDArray, int], ndimage.label(smooth))
    cells = side**2 / depth_map.cell**2
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    return [labels == k for k in range(1, count + 1) if 0.4 * cells < sizes[k] < 1.3 * cells]


def _face(depth_map: DepthMap, core: NDArray, side: float) -> CubeFace:
    """The face that a connected surface is the core of, with the tests that it must pass."""
    cell, z = depth_map.cell, depth_map.elevation
    plane = _plane(cell, z, core)
    j, i = np.indices(z.shape)
    off = z - (plane[0] + plane[1] * i * cell + plane[2] * j * cell)
    with np.errstate(invalid="ignore"):
        on = ndimage.binary_dilation(core, iterations=RIM_CELLS) & (np.abs(off) <= max(ON_SIGMAS * depth_map.noise, NEAREST_M))
    whole = np.asarray(ndimage.binary_fill_holes(on))
    normal = np.array([-plane[1], -plane[2], 1.0]) / np.sqrt(1.0 + plane[1] ** 2 + plane[2] ** 2)
    rim = np.argwhere(whole & np.logical_not(ndimage.binary_erosion(whole)))[:, ::-1] + 0.5
    square = _square(rim, np.argwhere(whole)[:, ::-1].mean(axis=0) + 0.5, side / cell)
    middle = square.middle * cell
    height = plane[0] + plane[1:] @ (middle - 0.5 * cell)
    reason = _unfit(whole, square, normal, side / cell)
    rms, area = float(np.sqrt(np.mean(off[on] ** 2))), int(whole.sum()) * cell**2 / float(normal[2])
    return CubeFace(not reason, reason, np.append(middle, height), normal, rms, area)


def _plane(cell: float, z: NDArray, mask: NDArray) -> NDArray:
    """c0, cx, cy (3,) of z = c0 + cx·x + cy·y with x and y counted in whole cells [m], by least squares."""
    j, i = np.nonzero(mask)
    return np.linalg.lstsq(np.stack([np.ones(len(i)), i * cell, j * cell], axis=1), z[j, i], rcond=None)[0]


class _Square(NamedTuple):
    """An outline in cells: its middle (2,), its side, the share of the rim's cells that lie on it, and the least covered side's share."""

    middle: NDArray
    side: float
    rim_share: float
    side_share: float


def _square(rim: NDArray, middle: NDArray, side: float) -> _Square:
    """The square that most of the rim's cells (n, 2) lie on, by least squares: place, turn and size. Cells off it are hidden ones' doing.

    The turn begins where the rim's fourth harmonic has it: a square has its corners in these directions.
    """
    arms = (rim - middle) @ np.array([1.0, 1.0j])
    turn, half = float(np.angle(-(arms**4).sum()) / 4.0), side / 2
    for k in range(FITS):
        local = (rim - middle) @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        axis = np.abs(local).argmax(axis=1)
        across, along = local[np.arange(len(rim)), axis], local[np.arange(len(rim)), 1 - axis]
        sign = np.sign(across)
        off = np.abs(across) - half
        near = np.abs(off) < np.interp(k, (0, FITS - 1), NEAR_CELLS)
        if near.sum() < 8:
            break
        columns = np.stack(
            [sign * (axis == 0), sign * (axis == 1), sign * along * np.where(axis == 0, -1.0, 1.0), np.ones(len(rim))], axis=1
        )
        step = np.linalg.lstsq(columns[near], off[near], rcond=None)[0]
        c, s = np.cos(turn), np.sin(turn)
        middle, half = middle + np.array([c * step[0] - s * step[1], s * step[0] + c * step[1]]), half + step[3]
        turn += step[2]
    covered = [np.unique(np.round(along[near & (axis == a) & (sign == way)])).size for a in (0, 1) for way in (-1.0, 1.0)]
    return _Square(middle, 2 * half + 1.0, float(near.mean()), min(covered) / side)


def _unfit(whole: NDArray, square: _Square, normal: NDArray, side: float) -> str:
    """Why a surface is not the cube's face, seen well enough; empty when it is."""
    if whole[[0, -1]].any() or whole[:, [0, -1]].any():
        return "the face leaves the depth map"
    tilt = float(np.arccos(normal[2]))
    if tilt > LEVEL_RAD:
        return f"the face leans by {np.rad2deg(tilt):.1f}°, limit {np.rad2deg(LEVEL_RAD):.0f}°"
    if abs(square.side - side) > SIZE_CELLS:
        return f"the face has sides of {square.side:.1f} cells, the cube's have {side:.1f} ± {SIZE_CELLS}"
    if square.rim_share < RIM_SHARE or square.side_share < SIDE_SHARE:
        seen = f"{100 * square.rim_share:.0f} % of its rim, {100 * square.side_share:.0f} % of the side that is seen least"
        return f"the face is no square or half hidden: only {seen} lie on its outline"
    return ""


def _none(reason: str) -> CubeFace:
    return CubeFace(False, reason, np.zeros(3), np.array([0.0, 0.0, 1.0]))
