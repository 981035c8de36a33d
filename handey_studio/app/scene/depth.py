"""The depth map as coloured points: elevation by colour, nothing where nothing was read."""

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app.palette import elevation_colours
from handey_studio.app.scene.units import scaled
from handey_studio.app.state import State
from handey_studio.sensing.depth_map import DepthMap

MAX_POINTS = 50_000
MIN_SPAN_M = 0.02  # an empty table is not blown up to mountains of noise


class DepthScene:
    """One point cloud, replaced when the scan changes."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._cloud: viser.PointCloudHandle | None = None

    def render(self, old: State | None, new: State) -> None:
        if old is None or old.session.scan is not new.session.scan:
            self._draw(new.session.scan)
        if self._cloud is not None:
            shown = "depth map" not in new.session.view.hidden_layers
            if self._cloud.visible != shown:
                self._cloud.visible = shown

    def _draw(self, scan: DepthMap | None) -> None:
        if self._cloud is not None:
            self._cloud.remove()
            self._cloud = None
        if scan is None:
            return
        stride = stride_of(scan)
        points, elevation = thinned(scan, stride)
        colours = elevation_colours(elevation / elevation_span(scan))
        self._cloud = self._server.scene.add_point_cloud(
            "/depth_map",
            scaled(points),
            colours,
            point_size=float(scaled(scan.cell * stride * 1.1)),
            point_shape="square",
            precision="float32",
            point_shading="flat",
        )


def stride_of(scan: DepthMap) -> int:
    """Every how-many-th cell is shown, so that a slow browser copes."""
    return int(np.ceil(np.sqrt(max(1.0, scan.elevation.size / MAX_POINTS))))


def thinned(scan: DepthMap, stride: int) -> tuple[NDArray, NDArray]:
    """Points (n, 3) [m] in the world and their elevations (n,) [m]."""
    grid = scan.elevation[::stride, ::stride]
    j, i = np.nonzero(np.isfinite(grid))
    points = np.c_[(i * stride + 0.5) * scan.cell, (j * stride + 0.5) * scan.cell, grid[j, i]]
    return points @ scan.T_world_range[:3, :3].T + scan.T_world_range[:3, 3], grid[j, i]


def elevation_span(scan: DepthMap) -> float:
    """The elevation [m] at the upper end of the colour scale."""
    seen = scan.elevation[np.isfinite(scan.elevation)]
    highest = float(np.percentile(seen, 99.9)) if len(seen) else 0.0
    return max(MIN_SPAN_M, np.ceil(highest / 0.01) * 0.01)
