"""The range finder (Handey 1987 §3): light stripes, two cameras, triangulation, and a grid of elevations.

A laser sweeps a plane of light over the table; each camera sees where that plane's stripe falls. A stripe's peak at
(u, v) puts the surface where the camera's ray meets the laser's plane. The cameras stand on either side of the laser, so
one sees most of what is hidden from the other; what the laser does not reach, nobody sees: that is the shadow.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.geometry.transforms import is_rigid, transform
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.depth_view import Pinhole
from handey_studio.sensing.light_paths import passing_heights

AREA_M = 0.4
SAME_SURFACE = 6.0  # readings of one cell within this many standard deviations of its highest are of one surface
NEIGHBOURS = tuple((dj, di) for dj in (-1, 0, 1) for di in (-1, 0, 1) if (dj, di) != (0, 0))
SPECK_SLOPE = 5.0  # surfaces steeper than this are not read: neighbours that differ by more than this many cells are not one surface
SPECK_NEIGHBOURS = 2
PINHOLE_NEIGHBOURS = 6  # a cell without a reading is a pinhole if so many of its eight neighbours have one
PINHOLE_SLOPE = 4.0  # and they differ by no more than this many cells in height: a steep face, not a step


@dataclass(frozen=True, eq=False)
class StripeCamera(Value):
    """A camera that watches the stripes. `T_range_camera` (4, 4) maps its optical frame to the range frame."""

    T_range_camera: NDArray
    focal_px: float = 1500.0
    width: int = 820
    height: int = 720

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_range_camera", frozen_array(self.T_range_camera))
        if not is_rigid(self.T_range_camera):
            raise BadInput("a range finder's camera needs a rigid 4×4 T_range_camera.")

    @property
    def projection(self) -> Pinhole:
        """Its pinhole, with the principal point in the middle."""
        return Pinhole(self.focal_px, self.focal_px, (self.width - 1) / 2.0, (self.height - 1) / 2.0)


def camera_looking_at(position: ArrayLike, target: ArrayLike) -> StripeCamera:
    """A camera at a position (3,) of the range frame that looks at a target (3,), its rows along the range frame's x."""
    forward = np.asarray(target, dtype=float) - np.asarray(position, dtype=float)
    forward /= np.linalg.norm(forward)
    right = np.array([1.0, 0.0, 0.0]) - forward[0] * forward
    right /= np.linalg.norm(right)
    return StripeCamera(transform(np.stack([right, np.cross(forward, right), forward], axis=1), position))


def _default_cameras() -> tuple[StripeCamera, ...]:
    middle = AREA_M / 2
    return tuple(camera_looking_at((middle + x, middle, 1.1), (middle, middle, 0.05)) for x in (-0.4, 0.4))


@dataclass(frozen=True, eq=False)
class RangeFinder(Value):
    """The instrument as data. All positions are in the range frame (z up, origin at the scan area's corner), in metres.

    `laser` (3,) is the source; its planes turn about the axis through it along y, `planes` of them at equal angles from
    −`sweep_rad` to `sweep_rad` off the vertical. `area` (x, y) is scanned into cells of side `cell`. `peak_noise_px` is the
    standard deviation of a stripe's peak along its row. Readings above `max_height` are strays.
    """

    T_world_range: NDArray = field(default_factory=lambda: transform(None, (0.48 - AREA_M / 2, -AREA_M / 2, 0.0)))
    area: tuple[float, float] = (AREA_M, AREA_M)
    cell: float = 0.001
    laser: NDArray = field(default_factory=lambda: np.array([AREA_M / 2, AREA_M / 2, 1.2]))
    planes: int = 960
    sweep_rad: float = 0.22
    cameras: tuple[StripeCamera, ...] = field(default_factory=_default_cameras)
    peak_noise_px: float = 0.25
    max_height: float = 0.35

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_range", frozen_array(self.T_world_range))
        object.__setattr__(self, "laser", frozen_array(self.laser))
        if not is_rigid(self.T_world_range) or abs(self.T_world_range[2, 2] - 1.0) > 1e-6:
            raise BadInput("the range finder's T_world_range must be rigid with z up, as the robot's.")
        if not 0.0001 <= self.cell <= 0.02 or not all(self.cell < side <= 4.0 for side in self.area):
            raise BadInput(
                f"a scan area of {self.area} m in cells of {self.cell} m is not usable; cells take 0.0001–0.02 m, sides up to 4 m."
            )
        if self.planes < 2 or not 0 < self.sweep_rad < 1.0 or not self.cameras:
            raise BadInput("the range finder needs a camera, at least 2 laser planes and a sweep between 0 and 1 rad.")

    @property
    def shape(self) -> tuple[int, int]:
        """Rows (y) and columns (x) of the depth map."""
        return round(self.area[1] / self.cell), round(self.area[0] / self.cell)

    @property
    def plane_angles(self) -> NDArray:
        """Angle (planes,) [rad] of each laser plane off the vertical, positive towards +x."""
        return np.linspace(-self.sweep_rad, self.sweep_rad, self.planes)

    @property
    def reading_noise(self) -> float:
        """Standard deviation [m] of the height of a single reading at the middle of the area, as the baseline gives it."""
        T = self.cameras[0].T_range_camera
        to_camera = T[:3, 3] - (self.area[0] / 2, self.area[1] / 2, 0.0)
        distance = float(np.linalg.norm(to_camera))
        return self.peak_noise_px * distance**2 / self.cameras[0].focal_px / abs(to_camera[0] - (self.laser[0] - self.area[0] / 2))


def triangulate(finder: RangeFinder, camera: int, u: NDArray, v: NDArray, plane: NDArray) -> NDArray:
    """Points (n, 3) [m] of the range frame where the rays of peaks (u, v) (n,) [px] meet laser planes, by number (n,)."""
    view = finder.cameras[camera]
    rays = view.projection.unproject(np.stack([u, v], axis=-1), np.ones(len(u))) @ view.T_range_camera[:3, :3].T
    origin = view.T_range_camera[:3, 3]
    angles = finder.plane_angles[plane]
    normals = np.stack([np.cos(angles), np.zeros(len(angles)), np.sin(angles)], axis=-1)
    along = (normals @ (finder.laser - origin)) / np.einsum("ij,ij->i", normals, rays)
    return origin + rays * along[:, None]


def fuse(finder: RangeFinder, points_range: NDArray, cameras: NDArray | None = None) -> DepthMap:
    """The depth map of readings (n, 3) [m]. In each cell the highest surface wins, as the mean of its readings.

    `cameras` (n,) tells which camera saw each reading; without it only the laser's light counts as having passed.
    Cells without a reading stay NaN, but for pinholes: single cells between readings of one surface take their median.
    """
    ny, nx = finder.shape
    finite = np.isfinite(points_range).all(axis=1)
    points, seen_by = points_range[finite], np.zeros(0) if cameras is None else cameras[finite]
    i, j = (np.floor(points[:, k] / finder.cell).astype(int) for k in (0, 1))
    kept = (i >= 0) & (j >= 0) & (i < nx) & (j < ny) & (np.abs(points[:, 2]) <= finder.max_height)
    number, z = (j * nx + i)[kept], points[kept, 2]
    highest = np.full(ny * nx, -np.inf)
    np.maximum.at(highest, number, z)
    top = z >= highest[number] - SAME_SURFACE * finder.reading_noise
    count = np.bincount(number[top], minlength=ny * nx)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(number[top], weights=z[top], minlength=ny * nx) / count
    readings = max(1.0, float(np.median(count[count > 0]))) if kept.any() else 1.0
    elevation = _without_pinholes(_without_specks(mean.reshape(ny, nx), SPECK_SLOPE * finder.cell), PINHOLE_SLOPE * finder.cell)
    return DepthMap(
        elevation=elevation,
        cell=finder.cell,
        T_world_range=finder.T_world_range,
        passed=passing_heights(elevation, finder.cell, *_lines(finder, points[kept], None if cameras is None else seen_by[kept])),
        noise=finder.reading_noise / np.sqrt(readings),
        outline_error=finder.cell,
    )


def _lines(finder: RangeFinder, points: NDArray, seen_by: NDArray | None) -> tuple[NDArray, NDArray]:
    """Readings and the far ends of the empty lines from them: each to the laser, and to the camera that saw it."""
    laser = np.broadcast_to(finder.laser, points.shape)
    if seen_by is None:
        return points, laser
    eyes = np.array([camera.T_range_camera[:3, 3] for camera in finder.cameras])[seen_by]
    return np.concatenate([points, points]), np.concatenate([laser, eyes])


def _without_specks(elevation: NDArray, tolerance: float) -> NDArray:
    """Without readings that fewer than `SPECK_NEIGHBOURS` of their neighbours share within `tolerance` [m].

    A stripe that an edge splits between two surfaces has its peak between them, and gives a reading in the air.
    """
    padded = np.pad(elevation, 1, constant_values=np.nan)
    ny, nx = elevation.shape
    alike = np.zeros((ny, nx), dtype=int)
    for dj, di in NEIGHBOURS:
        alike += np.abs(padded[1 + dj : 1 + dj + ny, 1 + di : 1 + di + nx] - elevation) <= tolerance
    return np.where(alike >= SPECK_NEIGHBOURS, elevation, np.nan)


def _without_pinholes(elevation: NDArray, tolerance: float) -> NDArray:
    """Empty cells whose neighbours lie within `tolerance` [m] of each other, filled with their median."""
    padded = np.pad(elevation, 1, constant_values=np.nan)
    j, i = np.nonzero(np.isnan(elevation))
    around = np.sort(np.stack([padded[1 + j + dj, 1 + i + di] for dj, di in NEIGHBOURS], axis=1), axis=1)  # NaN sorts last
    known = np.isfinite(around).sum(axis=1)
    enough = known >= PINHOLE_NEIGHBOURS
    j, i, around, known = j[enough], i[enough], around[enough], known[enough]
    spread = around[np.arange(len(j)), known - 1] - around[:, 0]
    flat = spread <= tolerance
    filled = elevation.copy()
    if flat.any():
        filled[j[flat], i[flat]] = np.nanmedian(around[flat], axis=1)
    return filled
