"""Where light has been: the lowest height above each cell of a depth map that light belonging to a reading went through."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.sensing.depth_map import SKY_M

CLEAR_M = 0.002  # followed until this far above the map's highest reading: beyond it there is no hole to pass over


def passing_heights(elevation: NDArray, cell: float, points: NDArray, viewpoints: NDArray) -> NDArray:
    """Heights (ny, nx) [m]: the elevation where there is one, else the lowest line from a reading to its viewpoint over the cell.

    `points` (n, 3) are readings and `viewpoints` (n, 3) where their light came from or went to, both in the range frame [m]: the
    line between them is empty. A cell that no line passes over gets `SKY_M`.
    """
    heights = np.where(np.isnan(elevation), SKY_M, elevation)
    holes = np.isnan(elevation)
    if holes.any() and len(points) and not holes.all():
        _lower_along_lines(heights, holes, cell, np.array(points), np.array(viewpoints), float(np.nanmax(elevation)) + CLEAR_M)
    return heights


@njit(cache=True)
def _lower_along_lines(heights: NDArray, holes: NDArray, cell: float, points: NDArray, viewpoints: NDArray, ceiling: float) -> None:
    ny, nx = heights.shape
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        dx, dy, dz = viewpoints[n, 0] - x, viewpoints[n, 1] - y, viewpoints[n, 2] - z
        across = np.hypot(dx, dy)
        if dz <= 0.0 or across < 1e-9:
            continue
        step = 0.5 * cell / across
        share = step
        while share < 1.0:
            height = z + share * dz
            if height > ceiling:
                break
            i, j = int(np.floor((x + share * dx) / cell)), int(np.floor((y + share * dy) / cell))
            if i < 0 or j < 0 or i >= nx or j >= ny:
                break
            if holes[j, i] and height < heights[j, i]:
                heights[j, i] = height
            share += step
