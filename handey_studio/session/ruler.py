"""What a click into the scene lies on: a located part, a reading or the table."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import apply
from handey_studio.task.sense import Scene
from handey_studio.world import PlacedPart

SNAP_RAD = 0.006  # about seven pixels in a window of ordinary height
BEHIND_M = 0.005  # a corner so little behind what is seen there is seen, too


def spot_at(scene: Scene | None, table_z: float, origin: NDArray, direction: NDArray) -> NDArray | None:
    """The point (3,) [m] of the world that a ray (origin (3,) [m], direction (3,)) meets first: a corner of a located part if one is near,
    else its surface, a reading, or the table at height `table_z` [m]; None where it meets nothing."""
    ray = direction / np.linalg.norm(direction)
    parts = scene.instances if scene is not None else ()
    spots = [_on_table(table_z, origin, ray), *_on_parts(parts, origin, ray)]
    if scene is not None:
        spots.append(_nearest(scene.depth_map.points_world(), origin, ray, np.inf))
    met = [spot for spot in spots if spot is not None]
    if not met:
        return None
    first = min(met, key=lambda spot: float((spot - origin) @ ray))
    corners = [apply(placed.T_world_part, placed.part.solid.vertices) for placed in parts]
    far = float((first - origin) @ ray) + BEHIND_M
    corner = _nearest(np.concatenate(corners), origin, ray, far) if corners else None
    return first if corner is None else corner


def _on_table(table_z: float, origin: NDArray, ray: NDArray) -> NDArray | None:
    return origin + (table_z - origin[2]) / ray[2] * ray if ray[2] < 0.0 and origin[2] > table_z else None


def _on_parts(parts: Sequence[PlacedPart], origin: NDArray, ray: NDArray) -> list[NDArray]:
    """Where the ray enters each part (Möller and Trumbore 1997)."""
    met = []
    for placed in parts:
        solid = placed.part.solid
        a, b, c = np.moveaxis(apply(placed.T_world_part, solid.vertices)[solid.triangles], 1, 0)
        across = np.cross(ray, c - a)
        size = np.sum((b - a) * across, axis=1)
        size = np.where(np.abs(size) > 1e-15, size, np.nan)
        u = np.sum((origin - a) * across, axis=1) / size
        other = np.cross(origin - a, b - a)
        v = other @ ray / size
        t = np.sum((c - a) * other, axis=1) / size
        hits = t[(u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0)]
        met += [origin + hits.min() * ray] if len(hits) else []
    return met


def _nearest(points: NDArray, origin: NDArray, ray: NDArray, far: float) -> NDArray | None:
    """Of points (n, 3) within `SNAP_RAD` of the ray and no farther along it than `far` [m] the one nearest to the ray, of those that lie
    about as near to its origin as the first; None if there is none."""
    along = (points - origin) @ ray
    off = np.linalg.norm(points - origin - along[:, None] * ray, axis=1)
    near = np.flatnonzero((along > 0.0) & (along <= far) & (off < SNAP_RAD * along))
    if not len(near):
        return None
    near = near[along[near] < along[near].min() + BEHIND_M]
    return points[near[np.argmin(off[near] / along[near])]]
