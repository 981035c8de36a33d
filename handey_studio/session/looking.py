"""What a look at a session needs to know: which readings are left once located parts are drawn, and what a click points at."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import frozen_array
from handey_studio.localization import DataEdge
from handey_studio.sensing.solid import solid_columns, without_parts
from handey_studio.task.sense import Scene

CLICK_RAD = 0.008  # about nine pixels in a window of ordinary height
SAMPLES = 24


@lru_cache(maxsize=4)
def unexplained(scene: Scene) -> NDArray:
    """Cells (ny, nx) bool whose reading no located part explains: these stay when the parts are drawn as solids."""
    columns = solid_columns(scene.depth_map)
    return frozen_array(without_parts(scene.depth_map, columns, scene.instances).top >= columns.top, bool)


def edge_at(edges: tuple[DataEdge, ...], origin: NDArray, direction: NDArray) -> int:
    """Number of the data edge that a ray (origin (3,) [m], direction (3,)) points at, the nearest first; -1 for none."""
    if not edges:
        return -1
    ends = np.array([edge.ends_world for edge in edges])
    shares = np.linspace(0.0, 1.0, SAMPLES)[None, :, None]
    points = ends[:, None, 0] * (1.0 - shares) + ends[:, None, 1] * shares - np.asarray(origin)
    depth = points @ (np.asarray(direction) / np.linalg.norm(direction))
    off = np.sqrt(np.maximum((points**2).sum(axis=2) - depth**2, 0.0))
    angle = np.where(depth > 0.0, np.arctan2(off, depth), np.inf).min(axis=1)
    best = int(np.argmin(angle))
    return best if angle[best] < CLICK_RAD else -1
