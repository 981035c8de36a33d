"""From triangulated readings to the paper's depth map: a grid of elevations in which the highest surface wins."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.light_paths import passing_heights

SAME_SURFACE = 6.0  # readings of one cell within this many standard deviations of its highest are of one surface
NEIGHBOURS = tuple((dj, di) for dj in (-1, 0, 1) for di in (-1, 0, 1) if (dj, di) != (0, 0))
SPECK_SLOPE = 5.0  # surfaces steeper than this are not read: neighbours that differ by more than this many cells are not one surface
SPECK_NEIGHBOURS = 2
PINHOLE_NEIGHBOURS = 6  # a cell without a reading is a pinhole if so many of its eight neighbours have one
PINHOLE_SLOPE = 4.0  # and they differ by no more than this many cells in height: a steep face, not a step


@dataclass(frozen=True, eq=False)
class ScanArea(Value):
    """The grid that readings are fused into: `shape` rows (y) and columns (x) of side `cell` [m] from the range frame's origin.

    `noise` [m] is the standard deviation of one reading's height; readings farther than `max_height` [m] from z = 0 are strays.
    """

    shape: tuple[int, int]
    cell: float
    T_world_range: NDArray
    noise: float
    max_height: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_range", frozen_array(self.T_world_range))


def fuse_readings(area: ScanArea, points_range: NDArray, viewpoints: tuple[NDArray, ...]) -> DepthMap:
    """The depth map of readings (n, 3) [m]. In each cell the highest surface wins, as the mean of its readings.

    Each of `viewpoints` (n, 3) or (3,) [m] is a place that each reading's light came from or went to: the lines between
    are empty. Cells without a reading stay NaN, but for pinholes: single cells between readings of one surface take their median.
    """
    kept = inside(area, points_range)
    points = points_range[kept]
    elevation, readings = elevations(area, points)
    ends = [view[kept] if view.ndim == 2 else np.broadcast_to(view, points.shape) for view in viewpoints]
    starts = np.concatenate([points] * len(ends)) if ends else np.zeros((0, 3))
    return DepthMap(
        elevation=elevation,
        cell=area.cell,
        T_world_range=area.T_world_range,
        passed=passing_heights(elevation, area.cell, starts, np.concatenate(ends) if ends else starts),
        noise=area.noise / np.sqrt(readings),
        outline_error=area.cell,
        rim_px=rim_of(readings),
    )


def rim_of(readings: float) -> float:
    """How far [px] an outline lies outside the middles of its outermost cells, each with so many `readings`: half of their spacing,
    for the outermost reading lies by chance within one spacing of the outline, and anywhere in its cell."""
    return 0.5 / float(np.sqrt(max(readings, 1.0)))


def inside(area: ScanArea, points_range: NDArray) -> NDArray:
    """Which readings (n, 3) are finite and fall into the grid."""
    ny, nx = area.shape
    with np.errstate(invalid="ignore"):
        x, y = points_range[:, 0] / area.cell, points_range[:, 1] / area.cell
        return (x >= 0) & (x < nx) & (y >= 0) & (y < ny) & (np.abs(points_range[:, 2]) <= area.max_height)


def elevations(area: ScanArea, points: NDArray) -> tuple[NDArray, float]:
    """Mean height [m] of each cell's highest surface, NaN where nothing was read, and the median number of readings a cell.

    The points (n, 3) [m] lie inside the area. Specks are taken out and pinholes filled.
    """
    ny, nx = area.shape
    i, j = (np.floor(points[:, k] / area.cell).astype(int) for k in (0, 1))
    number, z = j * nx + i, points[:, 2]
    highest = np.full(ny * nx, -np.inf)
    np.maximum.at(highest, number, z)
    top = z >= highest[number] - SAME_SURFACE * area.noise
    count = np.bincount(number[top], minlength=ny * nx)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(number[top], weights=z[top], minlength=ny * nx) / count
    readings = max(1.0, float(np.median(count[count > 0]))) if len(points) else 1.0
    grid = _without_specks(mean.reshape(ny, nx), SPECK_SLOPE * area.cell)
    return _without_pinholes(grid, PINHOLE_SLOPE * area.cell), readings


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
