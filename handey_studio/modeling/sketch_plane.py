"""The frame of a plane to sketch on, with its own natural axes, and what is seen in that plane."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.modeling.references import numbers, unit
from handey_studio.modeling.sketching import Guides

LEVEL = np.cos(np.deg2rad(3.0))  # a plane this near to level has no direction of its own that is upright
NEAR_PLANE_M = 0.002
IN_PLANE_RAD = float(np.deg2rad(3.0))


def sketch_plane(point: ArrayLike, normal: ArrayLike, along: ArrayLike | None = None) -> NDArray:
    """T_model_plane (4, 4): origin at `point` (3,) [m], z along `normal` (3,) and x along `along` (3,) as far as it is in the plane.

    Without `along`, x is level and y upright; in a level plane they are the model's. Raises BadInput for vectors without direction.
    """
    z = unit(normal, "the normal of the plane")
    x = np.array([1.0, 0.0, 0.0]) if abs(z[2]) > LEVEL else np.cross((0.0, 0.0, 1.0), z)
    if along is not None:
        x = np.asarray(along, dtype=float)
        if np.linalg.norm(np.cross(x, z)) < 1e-6 * max(float(np.linalg.norm(x)), 1e-9):
            raise BadInput("the direction of the sketch's x runs along the normal of its plane; choose an edge in the plane.")
    x = unit(x - z * (z @ x), "the direction of the sketch's x")
    T = np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3] = x, np.cross(z, x), z, numbers(point, (3,), "the point of the plane")
    return T


def guides_in_plane(T_model_plane: NDArray, points: ArrayLike, segments: ArrayLike, near_m: float = NEAR_PLANE_M) -> Guides:
    """What a sketch's clicks may snap to: of `points` (k, 3) and `segments` (m, 2, 3) [m] those within `near_m` of the plane, and the
    directions of all segments that run along it, each once."""
    T_plane_model = inverse(T_model_plane)
    flat = apply(T_plane_model, np.asarray(points, dtype=float).reshape(-1, 3))
    ends = apply(T_plane_model, np.asarray(segments, dtype=float).reshape(-1, 2, 3))
    ways = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(ways, axis=1)
    along = (lengths > 1e-6) & (np.abs(ways[:, 2]) < np.sin(IN_PLANE_RAD) * lengths)
    angles = np.arctan2(ways[along, 1], ways[along, 0]) % np.pi
    inside = along & (np.abs(ends[:, :, 2]).max(axis=1, initial=0.0) < near_m)
    return Guides(flat[np.abs(flat[:, 2]) < near_m, :2], ends[inside, :, :2], _distinct(angles))


def _distinct(angles: NDArray) -> NDArray:
    """Directions [rad] in [0, π) without those within half a degree of one before."""
    kept: list[float] = []
    for angle in np.sort(angles):
        if all(abs((angle - other + np.pi / 2) % np.pi - np.pi / 2) > np.deg2rad(0.5) for other in kept):
            kept.append(float(angle))
    return np.array(kept)
