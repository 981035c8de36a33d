"""The readings that a part claims: its triangles drawn into the view, held against the depth there."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.localization.evidence import Evidence
from handey_studio.sensing.drawing import draw, window


def claimed_pixels(corners_sensor: NDArray, triangles: NDArray, evidence: Evidence, agree: float) -> NDArray:
    """Numbers (k,), row by row, of the pixels whose readings lie within `agree` [m] of triangles drawn into the view."""
    width = evidence.depth.shape[1]
    corners = np.ascontiguousarray(corners_sensor)
    u0, v0, u1, v1 = window(corners, evidence.camera, evidence.depth.shape)
    depth, drawn = np.full((v1 - v0, u1 - u0), np.nan), np.full((v1 - v0, u1 - u0), -1, dtype=np.int32)
    draw(corners, np.ascontiguousarray(triangles), np.arange(len(triangles)), evidence.camera, u0, v0, depth, drawn)
    with np.errstate(invalid="ignore"):
        v, u = np.nonzero(np.abs(evidence.depth[v0:v1, u0:u1] - depth) < agree)
    return (v + v0) * width + u + u0
