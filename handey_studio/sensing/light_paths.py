"""Where light has been: the lowest height above each cell of a depth map that light belonging to a reading went through."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

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
        starts, ends = (np.require(given, requirements="W") for given in (points, viewpoints))
        _lower_along_lines(heights, _far_from(holes), cell, starts, ends, float(np.nanmax(elevation)) + CLEAR_M)
    return heights


def _far_from(holes: NDArray) -> NDArray:
    """How many half cells (ny, nx) a line may go on from a cell without meeting a hole; 0 in holes."""
    cells: Any = ndimage.distance_transform_edt(~holes)  # between the middles of cells, which lines miss by up to √½ of one
    return np.where(holes, 0, np.maximum(1, np.floor(2.0 * (cells - 2.0)))).astype(np.int64)


@njit(cache=True)
def _lower_along_lines(heights: NDArray, far: NDArray, cell: float, points: NDArray, viewpoints: NDArray, ceiling: float) -> None:
    """Looks along each line every half cell; what is far from every hole is passed over."""
    ny, nx = heights.shape
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        dx, dy, dz = viewpoints[n, 0] - x, viewpoints[n, 1] - y, viewpoints[n, 2] - z
        across = np.hypot(dx, dy)
        if dz <= 0.0 or across < 1e-9:
            continue
        step, look = 0.5 * cell / across, 1
        while look * step < 1.0:
            share = look * step
            height = z + share * dz
            if height > ceiling:
                break
            i, j = int(np.floor((x + share * dx) / cell)), int(np.floor((y + share * dy) / cell))
            if i < 0 or j < 0 or i >= nx or j >= ny:
                break
            if far[j, i] == 0 and height < heights[j, i]:
                heights[j, i] = height
            look += max(1, far[j, i])
