"""The sensor's own view: a depth image and how its pixels look into space. Visibility is decided here."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, frozen_array


@dataclass(frozen=True)
class Pinhole:
    """A perspective view: u = fx·x/z + cx, v = fy·y/z + cy [px]; pixel centres are whole numbers."""

    fx: float
    fy: float
    cx: float
    cy: float

    def project(self, points_sensor: NDArray) -> NDArray:
        """(u, v) [px] (..., 2) of points (..., 3) [m] in front of the sensor."""
        x, y, z = np.moveaxis(points_sensor, -1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.stack([self.fx * x / z + self.cx, self.fy * y / z + self.cy], axis=-1)

    def unproject(self, uv: NDArray, depth: NDArray) -> NDArray:
        """Points (..., 3) [m] at pixels (..., 2) and depths (...) [m] along the optical axis."""
        return np.stack([(uv[..., 0] - self.cx) / self.fx * depth, (uv[..., 1] - self.cy) / self.fy * depth, depth], axis=-1)

    def pixels_per_metre(self, depth: float | NDArray) -> float | NDArray:
        """How many pixels a metre across the view covers at a depth [m]."""
        return self.fx / depth

    def rays(self, points_sensor: NDArray) -> NDArray:
        """Unit directions (..., 3) from the sensor to points."""
        return points_sensor / np.linalg.norm(points_sensor, axis=-1, keepdims=True)


@dataclass(frozen=True)
class Orthographic:
    """A view from infinitely far: u = x/pixel + cx, v = y/pixel + cy [px]. A grid of elevations is such a view from above."""

    pixel: float
    cx: float
    cy: float

    def project(self, points_sensor: NDArray) -> NDArray:
        """(u, v) [px] (..., 2) of points (..., 3) [m]."""
        return points_sensor[..., :2] / self.pixel + (self.cx, self.cy)

    def unproject(self, uv: NDArray, depth: NDArray) -> NDArray:
        """Points (..., 3) [m] at pixels (..., 2) and depths (...) [m]."""
        return np.stack([(uv[..., 0] - self.cx) * self.pixel, (uv[..., 1] - self.cy) * self.pixel, depth], axis=-1)

    def pixels_per_metre(self, depth: float | NDArray) -> float | NDArray:
        """How many pixels a metre across the view covers; the same at every depth."""
        return 1.0 / self.pixel + 0.0 * depth

    def rays(self, points_sensor: NDArray) -> NDArray:
        """Unit directions (..., 3) of the light: all along the optical axis."""
        rays = np.zeros_like(points_sensor)
        rays[..., 2] = 1.0
        return rays


@dataclass(frozen=True, eq=False)
class DepthView(Value):
    """A depth image. `depth` (H, W) [m] along the optical axis, NaN where there is no reading; what cannot be one, endless or behind
    the eye, becomes NaN. BadInput for an image without pixels.

    `T_world_sensor` maps the optical frame (x right, y down, z forward) to the world. `noise` [m] is the standard
    deviation of a reading on a plane; `outline_error` [m] how far a silhouette may lie off sideways, as depth cameras
    drop readings at jump edges. `rim_px`: how far it lies outside the middles of its outermost pixels where nothing is dropped:
    half a pixel if each pixel is one reading, less if the highest of several wins.
    """

    depth: NDArray
    projection: Pinhole | Orthographic
    T_world_sensor: NDArray = field(default_factory=lambda: np.eye(4))
    noise: float = 0.0015
    outline_error: float = 0.004
    rim_px: float = 0.5

    def __post_init__(self) -> None:
        object.__setattr__(self, "depth", frozen_array(_readings(np.asarray(self.depth), self.projection)))
        object.__setattr__(self, "T_world_sensor", frozen_array(self.T_world_sensor))

    def points_sensor(self) -> NDArray:
        """Points (H, W, 3) [m] in the optical frame, NaN where there is no reading."""
        v, u = np.mgrid[: self.depth.shape[0], : self.depth.shape[1]]
        return self.projection.unproject(np.stack([u, v], axis=-1).astype(float), self.depth)


def _readings(depth: NDArray, projection: Pinhole | Orthographic) -> NDArray:
    """A depth image (H, W) with NaN for what cannot be a reading."""
    if depth.ndim != 2 or not depth.size:
        raise BadInput(f"a depth image must be a table of one pixel or more, not of shape {depth.shape}.")
    least = 0.0 if isinstance(projection, Pinhole) else -np.inf
    impossible = (depth <= least) | (depth == np.inf)
    return np.where(impossible, np.nan, depth) if impossible.any() else depth
