"""What speaks against a pose of another scan: readings that would hang where a sensor looked through, or below the support."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from handey_studio.geometry.transforms import apply, inverse
from handey_studio.modeling.patches.patch import Patches
from handey_studio.modeling.patches.sides import lost_at_rims
from handey_studio.modeling.scans import Scan
from handey_studio.sensing.depth_view import DepthView

SAMPLES = 400  # readings of a patch that take part
FREE_SIGMAS, LEAST_FREE_M = 8.0, 0.001  # a reading so far in front of all that was read around there hangs in the open
RIM_LOSSES = 2.0  # "around there": so many times what is lost at rims


class Seen(NamedTuple):
    """One scan's part in the comparison: its `view`, the `nearest` depth (H, W) [m] around each pixel, and some `readings` (n, 3) [m] of
    the object in the scan's world."""

    view: DepthView
    nearest: NDArray
    readings: NDArray


def seen_by(scan: Scan, patches: Patches, numbers: tuple[int, ...]) -> Seen:
    """What a scan shows of the object that has these patches."""
    depth = np.nan_to_num(scan.view.depth, nan=np.inf)
    readings = np.concatenate([readings_of(scan, patches, number) for number in numbers])
    middle = float(np.median(apply(inverse(scan.view.T_world_sensor), readings)[:, 2]))
    scale = float(scan.view.projection.pixels_per_metre(middle))
    margin = 1 + int(np.ceil(RIM_LOSSES * lost_at_rims(scan.view) * scale))
    return Seen(scan.view, minimum_filter(depth, size=2 * margin + 1), readings)


def readings_of(scan: Scan, patches: Patches, number: int) -> NDArray:
    """Some readings (n, 3) [m] of a patch, in the scan's world."""
    rows, columns = np.nonzero(patches.labels == number)
    every = max(1, len(rows) // SAMPLES)
    rows, columns = rows[::every], columns[::every]
    uv = np.stack([columns, rows], axis=1).astype(float)
    return apply(scan.view.T_world_sensor, scan.view.projection.unproject(uv, scan.view.depth[rows, columns]))


def open_share(one: Seen, T_one_other: NDArray, other: Seen) -> float:
    """The share of the object's readings in either scan that the other one contradicts, the larger of the two."""
    return max(_contradicted(one, apply(T_one_other, other.readings)), _contradicted(other, apply(inverse(T_one_other), one.readings)))


def _contradicted(seen: Seen, points: NDArray) -> float:
    """The share of points (n, 3) [m] of a scan's world that lie below the support or well in front of all that was read around there."""
    local = apply(inverse(seen.view.T_world_sensor), points)
    with np.errstate(invalid="ignore"):
        uv = np.nan_to_num(np.rint(seen.view.projection.project(local)), nan=-1.0)
    height, width = seen.nearest.shape
    inside = (uv >= 0).all(axis=1) & (uv < (width, height)).all(axis=1)
    u, v = (uv[inside, k].astype(int) for k in (0, 1))
    nearest = seen.nearest[v, u]
    tolerance = FREE_SIGMAS * seen.view.noise + LEAST_FREE_M
    floating = np.isfinite(nearest) & (local[inside, 2] < nearest - tolerance)
    return float((floating.sum() + (points[:, 2] < -tolerance).sum()) / max(len(points), 1))
