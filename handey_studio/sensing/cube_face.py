"""The upper face of the calibration cube in a depth map (Handey 1987 §6): its plane, and its middle to a fraction of a cell."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handey_studio.base import Value, frozen_array
from handey_studio.sensing.depth_map import DepthMap

SMOOTH_SIGMAS, SMOOTHEST_M = 6.0, 0.001  # neighbours that differ by no more are of one surface
ON_SIGMAS, NEAREST_M = 5.0, 0.001  # readings so near to the face's plane are on it
RIM_CELLS = 2  # the rim's cells have neighbours that are not of the face
AREA_SHARE = 0.1  # by which a face's area may differ from the cube's, where each side counts cells that it only touches
SQUARE_SHARE = 0.12  # the like for its second moments: a face that is half hidden, or no square, has others
LEVEL_RAD = np.deg2rad(10.0)


@dataclass(frozen=True, eq=False)
class CubeFace(Value):
    """The cube's upper face, or why it was not found.

    `middle_range` (3,) [m] is the centroid of its outline, on its plane; `normal_range` (3,) points up; `rms_m` is how far its readings
    are off the plane, `area_m2` what they cover.
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
    v, u = np.nonzero(whole)
    xy = np.stack([(u + 0.5) * cell, (v + 0.5) * cell], axis=1)
    middle, normal = xy.mean(axis=0), np.array([-plane[1], -plane[2], 1.0]) / np.sqrt(1.0 + plane[1] ** 2 + plane[2] ** 2)
    height = plane[0] + plane[1:] @ (middle - 0.5 * cell)
    rms, area = float(np.sqrt(np.mean(off[on] ** 2))), len(xy) * cell**2 / float(normal[2])
    reason = _unfit(whole, xy, area, normal, side)
    return CubeFace(not reason, reason, np.append(middle, height), normal, rms, area)


def _plane(cell: float, z: NDArray, mask: NDArray) -> NDArray:
    """c0, cx, cy (3,) of z = c0 + cx·x + cy·y with x and y counted in whole cells [m], by least squares."""
    j, i = np.nonzero(mask)
    return np.linalg.lstsq(np.stack([np.ones(len(i)), i * cell, j * cell], axis=1), z[j, i], rcond=None)[0]


def _unfit(whole: NDArray, xy: NDArray, area: float, normal: NDArray, side: float) -> str:
    """Why a surface is not the cube's whole face; empty when it is."""
    if whole[[0, -1]].any() or whole[:, [0, -1]].any():
        return "the face leaves the depth map"
    tilt = float(np.arccos(normal[2]))
    if tilt > LEVEL_RAD:
        return f"the face leans by {np.rad2deg(tilt):.1f}°, limit {np.rad2deg(LEVEL_RAD):.0f}°"
    if abs(area / side**2 - 1.0) > AREA_SHARE:
        return f"the face covers {1e6 * area:.0f} mm², the cube's has {1e6 * side**2:.0f} ± {100 * AREA_SHARE:.0f} %; something may hide it"
    moments = np.linalg.eigvalsh(np.cov(xy.T)) / (side**2 / 12.0)
    if np.abs(moments - 1.0).max() > SQUARE_SHARE:
        return f"the face is no square of {1e3 * side:.0f} mm: its sides are as {np.sqrt(moments[0]):.2f} to {np.sqrt(moments[1]):.2f}"
    return ""


def _none(reason: str) -> CubeFace:
    return CubeFace(False, reason, np.zeros(3), np.array([0.0, 0.0, 1.0]))
