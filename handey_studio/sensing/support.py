"""The support plane: the largest plane in a view that everything stands on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.geometry.transforms import transform
from handey_studio.sensing.depth_view import DepthView

SAMPLES = 6000  # readings that vote
TRIALS = 400  # planes through three readings; with a share of 30 % inliers one in 37 is good
MIN_SHARE = 0.15  # of the readings; less is no table
BELOW_COST = 3.0  # a reading below the plane speaks against it three times as loudly as one on it speaks for it
REFINEMENTS = 6


@dataclass(frozen=True, eq=False)
class SupportPlane(Value):
    """The plane that everything stands on, as the frame of a world.

    `T_world_sensor` (4, 4) puts the plane at z = 0 with z towards the sensor and the origin under the sensor; it is the
    identity when none was found, and `reason` then says why. `inliers` readings lie on it, `share` of all, `rms` [m].
    """

    found: bool
    T_world_sensor: NDArray
    inliers: int
    share: float
    rms: float
    reason: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_sensor", frozen_array(self.T_world_sensor))


def support_plane(view: DepthView, rng: np.random.Generator) -> SupportPlane:
    """The plane with the most readings on it and few below it, by random triples and robust least squares."""
    points = view.points_sensor()
    points = points[np.isfinite(points).all(axis=-1)]
    if len(points) < 3:
        return SupportPlane(False, np.eye(4), 0, 0.0, 0.0, f"the view has {len(points)} readings")
    sample = points[rng.choice(len(points), min(SAMPLES, len(points)), replace=False)]
    tolerance = 3.0 * view.noise
    normal, offset = _best_plane(sample, tolerance, rng)
    for width in np.geomspace(2.0 * tolerance, tolerance, REFINEMENTS):
        on = np.abs(sample @ normal - offset) < width
        if on.sum() < 3:
            break
        normal, offset = _least_squares(sample[on], normal)
    residuals = points @ normal - offset
    on = np.abs(residuals) < tolerance
    share = float(on.mean())
    if share < MIN_SHARE:
        reason = f"the largest plane holds {100 * share:.0f} % of the readings, a support needs {100 * MIN_SHARE:.0f} %"
        return SupportPlane(False, np.eye(4), int(on.sum()), share, 0.0, reason)
    rms = float(np.sqrt(np.mean(residuals[on] ** 2)))
    return SupportPlane(True, _frame(normal, offset), int(on.sum()), share, rms)


def _best_plane(points: NDArray, tolerance: float, rng: np.random.Generator) -> tuple[NDArray, float]:
    """Unit normal towards the sensor and offset of the best of many planes through three points."""
    a, b, c = (points[rng.integers(len(points), size=TRIALS)] for _ in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    usable = lengths > 1e-9
    normals, a = normals[usable] / lengths[usable, None], a[usable]
    if not len(normals):
        return np.array([0.0, 0.0, -1.0]), -float(points[:, 2].max())
    offsets = np.einsum("ij,ij->i", normals, a)
    flip = np.where(offsets > 0, -1.0, 1.0)  # the sensor, at the origin, is on the plane's upper side
    normals, offsets = normals * flip[:, None], offsets * flip
    heights = points @ normals.T - offsets
    votes = (np.abs(heights) < tolerance).sum(axis=0) - BELOW_COST * (heights < -2.0 * tolerance).sum(axis=0)
    best = int(np.argmax(votes))
    return normals[best], float(offsets[best])


def _least_squares(points: NDArray, towards: NDArray) -> tuple[NDArray, float]:
    centre = points.mean(axis=0)
    normal = np.linalg.svd(points - centre, full_matrices=False)[2][2]
    normal = normal if normal @ towards > 0 else -normal
    return normal, float(normal @ centre)


def _frame(normal: NDArray, offset: float) -> NDArray:
    """T_world_sensor: z along the normal, origin at the sensor's foot, x as near the sensor's x as it can be."""
    reference = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = reference - (reference @ normal) * normal
    x /= np.linalg.norm(x)
    R_world_sensor = np.stack([x, np.cross(normal, x), normal])
    return transform(R_world_sensor, (0.0, 0.0, -offset))
