"""What lies under something in the grasp plane: a hand with a part in it is out when nothing is above it any more."""

from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.grasping.grasp_plane import GraspPlane

LEAST_UP = 0.2  # of the upward direction must lie in a plane for it to lead up


def under_roofs(plane: GraspPlane) -> GraspPlane:
    """The plane with all cells filled that lie under a filled one; the same if no direction in the plane leads up."""
    up = plane.T_world_plane[2, 1:3]
    if np.abs(up).max() < LEAST_UP:
        return plane
    down = -up / np.abs(up).max()
    grids = {key: np.array(getattr(plane, key)) for key in ("fingers", "crosspiece", "mount", "held")}
    for grid in grids.values():
        _fill_below(grid, grid.copy(), float(down[0]), float(down[1]))
    return replace(plane, **grids)


@njit(cache=True)
def _fill_below(grid: NDArray, filled: NDArray, down_y: float, down_z: float) -> None:
    """Mark the cells from each filled one on, one step after the other; one that has a filled one below it is passed over."""
    n = len(grid)
    for i in range(n):
        for k in range(n):
            if not filled[i, k]:
                continue
            y, z, steps = i + 0.5, k + 0.5, 0
            while 0.0 <= y < n and 0.0 <= z < n and (steps != 1 or not filled[int(y), int(z)]):
                grid[int(y), int(z)] = True
                y, z, steps = y + down_y, z + down_z, steps + 1
