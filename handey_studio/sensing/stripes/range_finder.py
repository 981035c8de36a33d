"""The range finder (Handey 1987 §3): light stripes, two cameras, triangulation, and a grid of elevations.

A laser sweeps a plane of light over the table; each camera sees where that plane's stripe falls. A stripe's peak at
(u, v) puts the surface where the camera's ray meets the laser's plane. The cameras stand on either side of the laser, so
one sees most of what is hidden from the other; what the laser does not reach, nobody sees: that is the shadow.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.geometry.transforms import is_rigid, transform
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.stripes.fusing import ScanArea, fuse_readings
from handey_studio.sensing.stripes.laser_planes import turning_planes
from handey_studio.sensing.stripes.stripe_camera import StripeCamera, camera_looking_at, points_on_planes

AREA_M = 0.4


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
    def laser_planes(self) -> NDArray:
        """The planes of light (planes, 4) in the range frame."""
        return turning_planes(self.laser, (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), self.plane_angles)

    @property
    def reading_noise(self) -> float:
        """Standard deviation [m] of the height of a single reading at the middle of the area, as the baseline gives it."""
        T = self.cameras[0].T_range_camera
        to_camera = T[:3, 3] - (self.area[0] / 2, self.area[1] / 2, 0.0)
        distance = float(np.linalg.norm(to_camera))
        return self.peak_noise_px * distance**2 / self.cameras[0].focal_px / abs(to_camera[0] - (self.laser[0] - self.area[0] / 2))

    @property
    def scan_area(self) -> ScanArea:
        """The grid that its readings are fused into."""
        return ScanArea(self.shape, self.cell, self.T_world_range, self.reading_noise, self.max_height)


def triangulate(finder: RangeFinder, camera: int, u: NDArray, v: NDArray, plane: NDArray) -> NDArray:
    """Points (n, 3) [m] of the range frame where the rays of peaks (u, v) (n,) [px] meet laser planes, by number (n,)."""
    return points_on_planes(finder.cameras[camera], np.stack([u, v], axis=-1), finder.laser_planes[plane])


def fuse(finder: RangeFinder, points_range: NDArray, cameras: NDArray | None = None) -> DepthMap:
    """The depth map of readings (n, 3) [m]. In each cell the highest surface wins, as the mean of its readings.

    `cameras` (n,) tells which camera saw each reading; without it only the laser's light counts as having passed.
    Cells without a reading stay NaN, but for pinholes: single cells between readings of one surface take their median.
    """
    if cameras is None:
        return fuse_readings(finder.scan_area, points_range, (finder.laser,))
    eyes = np.array([camera.T_range_camera[:3, 3] for camera in finder.cameras])[cameras]
    return fuse_readings(finder.scan_area, points_range, (finder.laser, eyes))
