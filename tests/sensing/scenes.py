"""Depth images of boxes on a table with known truth, by slabs: every ray against every box."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import from_xyz_rpy, inverse, transform
from handey_studio.sensing.depth_view import Orthographic, Pinhole

Boxes = list[tuple[NDArray, NDArray]]  # T_world_box, half sides [m]


def looking_at(eye, target) -> NDArray:
    """T_world_sensor (4, 4) of a sensor at `eye` that looks at `target`."""
    z = (np.asarray(target, float) - eye) / np.linalg.norm(np.asarray(target, float) - eye)
    x = np.cross(z, [0.0, 0.0, 1.0]) if abs(z[2]) < 0.999 else np.array([1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    return transform(np.stack([x, np.cross(z, x), z], axis=1), eye)


def pile(rng: np.random.Generator, count: int, spread: float = 0.2, side: tuple[float, float] = (0.02, 0.08)) -> Boxes:
    """Boxes of random sizes at random tilts about the origin, on or in the table: their depth counts, not their weight."""
    return [
        (from_xyz_rpy((*rng.uniform(-spread, spread, 2), rng.uniform(0.0, 0.06)), rng.uniform(-0.5, 0.5, 3)), rng.uniform(*side, 3))
        for _ in range(count)
    ]


def bin_walls(width: float, length: float, height: float, thickness: float = 0.004) -> Boxes:
    """Four walls around a floor of width × length [m] at z = 0."""
    walls = []
    for x, y, a, b in (
        (0.5 * width, 0, 0, length),
        (-0.5 * width, 0, 0, length),
        (0, 0.5 * length, width, 0),
        (0, -0.5 * length, width, 0),
    ):
        walls.append(
            (transform(translation=(x, y, 0.5 * height)), np.array([max(0.5 * a, thickness), max(0.5 * b, thickness), 0.5 * height]))
        )
    return walls


def cast(
    boxes: Boxes, T_world_sensor: NDArray, projection: Pinhole | Orthographic, shape: tuple[int, int], table: float | None = 0.0
) -> NDArray:
    """Exact depth (H, W) [m] of boxes and of the table z = `table`, NaN where a ray meets nothing."""
    v, u = np.mgrid[: shape[0], : shape[1]].astype(float)
    far = projection.unproject(np.stack([u, v], axis=-1), np.ones(shape))
    near = projection.unproject(np.stack([u, v], axis=-1), np.zeros(shape))
    T_sensor_world = inverse(T_world_sensor)
    depth = np.full(shape, np.inf)
    slabs = [(T_sensor_world @ T, half) for T, half in boxes]
    if table is not None:
        slabs.append((T_sensor_world @ transform(translation=(0, 0, table - 0.05)), np.array([50.0, 50.0, 0.05])))
    for T_sensor_box, half in slabs:
        origins, ends = (points @ T_sensor_box[:3, :3] - T_sensor_box[:3, 3] @ T_sensor_box[:3, :3] for points in (near, far))
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = ((sign * half - origins) / (ends - origins) for sign in (-1.0, 1.0))
        enter, leave = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
        hit = (enter <= leave) & (enter > 0) & (enter < depth)
        depth[hit] = enter[hit]
    return np.where(np.isfinite(depth), depth, np.nan)
