"""Clouds as depth images: organised ones by their pinhole, others by the grid that their points fill."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import inverse
from handey_studio.sensing.depth_view import Orthographic, Pinhole
from handey_studio.sensing.reading.clouds import Cloud
from handey_studio.sensing.reading.gridding import grid_points, into_camera
from handey_studio.sensing.reading.pinhole_fit import MIN_READINGS, PINHOLE_RMS_PX, fit_pinhole

UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001}
WIDEST_M, NARROWEST_M = 30.0, 0.01  # clouds of other sizes are in another unit than was said
SEED = 0  # of the support's search in a list of points: the same file gives the same view

View = tuple[NDArray, Pinhole | Orthographic, NDArray]


def view_of_cloud(path: Path, cloud: Cloud, unit_m: float, pinhole: Pinhole | None, size: tuple[int, int] | None) -> View:
    """Depth (H, W) [m], projection, and where the view stands in the cloud's frame (4, 4) [m]; `path` is for messages.

    With `pinhole` the cloud is in that camera's frame, of `size` (height, width) [px] if known. Raises BadInput with one sentence.
    """
    T_cloud_sensor = None if cloud.T_cloud_sensor is None else cloud.T_cloud_sensor.copy()
    if T_cloud_sensor is not None:
        T_cloud_sensor[:3, 3] *= unit_m
    points = cloud.points if unit_m == 1.0 else cloud.points * cloud.points.dtype.type(unit_m)
    _check_extent(path, points, unit_m)
    if pinhole is not None:
        if cloud.organised:
            return np.array(points[..., 2], dtype=float), pinhole, np.eye(4)
        return into_camera(_finite(points), pinhole, size), pinhole, np.eye(4)
    why = ""
    if cloud.organised:
        found = fit_pinhole(points, T_cloud_sensor)
        if found is not None and found.rms_px <= PINHOLE_RMS_PX:
            return _along(points, inverse(found.T_cloud_sensor)), found.pinhole, found.T_cloud_sensor
        missed = "" if found is None else f" (its points miss their pixels by {found.rms_px:.3g} px rms, the limit is {PINHOLE_RMS_PX:g})"
        why = f"is not the image of one pinhole{missed} and "
    viewpoints = [] if T_cloud_sensor is None or np.allclose(T_cloud_sensor, np.eye(4)) else [T_cloud_sensor]
    gridded = grid_points(_finite(points), [*viewpoints, np.eye(4)], np.random.default_rng(SEED))
    if gridded is None:
        raise BadInput(
            f'cloud "{path}" {why}does not look like seen from its origin, nor does it show a plane to look down on; '
            f"give the camera, or a cloud as one camera sees it."
        )
    return gridded.depth, gridded.projection, gridded.T_cloud_sensor


def _finite(points: NDArray) -> NDArray:
    """Points (n, 3) without the missing ones."""
    flat = points.reshape(-1, 3)
    return flat[np.isfinite(flat[:, 2])]


def _along(points: NDArray, T_sensor_cloud: NDArray) -> NDArray:
    """Depths (H, W) of points (H, W, 3)."""
    if np.array_equal(T_sensor_cloud, np.eye(4)):
        return np.array(points[..., 2], dtype=float)
    depth = np.full(points.shape[:2], T_sensor_cloud[2, 3])
    for k in range(3):
        depth += T_sensor_cloud[2, k] * points[..., k]
    return depth


def _check_extent(path: Path, points: NDArray, unit_m: float) -> None:
    """Raises BadInput for clouds with too few points or of a size that no table has."""
    flat = points.reshape(-1, 3)
    known = int(np.isfinite(flat[:, 2]).sum())
    if known < MIN_READINGS:
        raise BadInput(f'cloud "{path}" has {known} readings; at least {MIN_READINGS} are needed.')
    some = flat[:: max(1, len(flat) // 50_000)].astype(float)
    some = some[np.isfinite(some[:, 2])]
    some = some if len(some) >= MIN_READINGS else flat[np.isfinite(flat[:, 2])].astype(float)
    with np.errstate(over="ignore"):
        span = float(np.linalg.norm(np.subtract(*np.quantile(some, [0.95, 0.05], axis=0))))
    unit = next(name for name, value in UNITS_M.items() if value == unit_m)
    if not NARROWEST_M <= span <= WIDEST_M:
        hint = (
            "if its coordinates are millimetres, say so with --cloud-unit mm"
            if span > WIDEST_M
            else "give the unit of its coordinates with --cloud-unit"
        )
        raise BadInput(
            f'cloud "{path}" is {span:.3g} m across when read in {unit}; the limits are {NARROWEST_M:g} and {WIDEST_M:g} m; {hint}.'
        )
