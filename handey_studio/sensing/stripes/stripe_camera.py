"""A camera that watches the laser's stripes: pinhole and lens, where it stands, and where its peaks lie in space."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.geometry.transforms import is_rigid, transform
from handey_studio.sensing.depth_view import Pinhole

LENS_COEFFICIENTS = (0, 4, 5, 8, 12)  # OpenCV's lenses: radial and tangential, with k3, with k4–k6, with s1–s4
LENS_TOLERANCE_PX = 0.1  # a pixel whose undistorted ray does not come back to it lies where the lens's polynomial folds over
LENS_ROUNDS, LENS_ENOUGH_PX = 12, 1e-5
GRAZING_SINE = 0.02  # a ray that meets the laser's plane flatter than 1.1° says nothing about where


@dataclass(frozen=True, eq=False)
class StripeCamera(Value):
    """A camera that watches the stripes. `T_range_camera` (4, 4) maps its optical frame to the range frame.

    `aspect` is fy / fx; `centre_px` the principal point (cx, cy), the middle when None. `distortion` are OpenCV's lens
    coefficients k1, k2, p1, p2[, k3, …]; none is a lens without distortion.
    """

    T_range_camera: NDArray
    focal_px: float = 1500.0
    width: int = 820
    height: int = 720
    aspect: float = 1.0
    centre_px: tuple[float, float] | None = None
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_range_camera", frozen_array(self.T_range_camera))
        if not is_rigid(self.T_range_camera):
            raise BadInput("a range finder's camera needs a rigid 4×4 T_range_camera.")
        if len(self.distortion) not in LENS_COEFFICIENTS:
            raise BadInput(f"a camera's distortion has {len(self.distortion)} numbers; it takes one of {LENS_COEFFICIENTS}.")

    @property
    def projection(self) -> Pinhole:
        """Its pinhole, without the lens."""
        cx, cy = ((self.width - 1) / 2.0, (self.height - 1) / 2.0) if self.centre_px is None else self.centre_px
        return Pinhole(self.focal_px, self.focal_px * self.aspect, cx, cy)

    @property
    def matrix(self) -> NDArray:
        """OpenCV's camera matrix (3, 3)."""
        view = self.projection
        return np.array([[view.fx, 0.0, view.cx], [0.0, view.fy, view.cy], [0.0, 0.0, 1.0]])

    def rays(self, uv: NDArray) -> NDArray:
        """Directions (n, 3) of the optical frame, z = 1, through pixels (n, 2) of the photograph; NaN where the lens has no inverse."""
        uv = np.asarray(uv, dtype=float)
        if not any(self.distortion) or not len(uv):
            return self.projection.unproject(uv, np.ones(len(uv)))
        view = self.projection
        flat = cv2.undistortPoints(np.ascontiguousarray(uv[:, None]), self.matrix, np.array(self.distortion)).reshape(-1, 2)
        rays = np.concatenate([flat, np.ones((len(flat), 1))], axis=1)
        with np.errstate(over="ignore", invalid="ignore"):  # where the lens has no inverse the rounds run away
            for _ in range(LENS_ROUNDS):  # OpenCV stops after five rounds of its own, some hundredths of a pixel off with strong lenses
                missed = uv - self.project(rays)
                rays[:, :2] += missed / (view.fx, view.fy)
                if not np.max(np.abs(missed)) > LENS_ENOUGH_PX:
                    break
            missed = np.abs(self.project(rays) - uv).max(axis=1)
        rays[~(missed <= LENS_TOLERANCE_PX)] = np.nan
        return rays

    def project(self, points_camera: NDArray) -> NDArray:
        """Pixels (n, 2) of the photograph at which points (n, 3) [m] of the optical frame, in front of the camera, are seen."""
        if any(self.distortion):
            points_camera = _through_lens(np.asarray(points_camera, dtype=float), self.distortion)
        return self.projection.project(points_camera)


def _through_lens(points: NDArray, distortion: tuple[float, ...]) -> NDArray:
    """Directions (n, 3), z = 1, in which points (n, 3) are seen through a lens: Brown's model, as OpenCV orders it."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = (*distortion, *(0.0,) * (max(LENS_COEFFICIENTS) - len(distortion)))
    x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    r2 = x * x + y * y
    radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    bent_x = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + r2 * (s1 + r2 * s2)
    bent_y = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + r2 * (s3 + r2 * s4)
    return np.stack([bent_x, bent_y, np.ones_like(x)], axis=1)


def camera_looking_at(position: ArrayLike, target: ArrayLike) -> StripeCamera:
    """A camera at a position (3,) of the range frame that looks at a target (3,), its rows along the range frame's x."""
    forward = np.asarray(target, dtype=float) - np.asarray(position, dtype=float)
    forward /= np.linalg.norm(forward)
    right = np.array([1.0, 0.0, 0.0]) - forward[0] * forward
    right /= np.linalg.norm(right)
    return StripeCamera(transform(np.stack([right, np.cross(forward, right), forward], axis=1), position))


def points_on_planes(camera: StripeCamera, uv: NDArray, planes: NDArray) -> NDArray:
    """Points (n, 3) [m] of the range frame where the rays of peaks (n, 2) [px] meet laser planes (n, 4) or one (4,).

    A plane (nx, ny, nz, d) holds the points p with n·p = d; n has length 1. NaN where the ray grazes its plane or meets it
    behind the camera.
    """
    rays = camera.rays(uv) @ camera.T_range_camera[:3, :3].T
    planes = np.broadcast_to(planes, (len(rays), 4))
    origin = camera.T_range_camera[:3, 3]
    across = np.einsum("ij,ij->i", planes[:, :3], rays)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (planes[:, 3] - planes[:, :3] @ origin) / across
        good = (along > 0) & (np.abs(across) >= GRAZING_SINE * np.linalg.norm(rays, axis=1))
    return origin + rays * np.where(good, along, np.nan)[:, None]
