"""The depth map as coloured points: elevation by colour, nothing where nothing was read."""

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app.palette import elevation_colours
from handey_studio.app.scene.units import scaled
from handey_studio.app.state import State
from handey_studio.localization.explain import Explanation
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.session.looking import cells_of, unexplained

MAX_POINTS = 50_000
MIN_SPAN_M = 0.02  # an empty table is not blown up to mountains of noise


class DepthScene:
    """One point cloud, replaced when the scan changes. Readings that a located part explains go when the part is drawn, those that
    stand in colours of their own as well."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._cloud: viser.PointCloudHandle | None = None

    def render(self, old: State | None, new: State) -> None:
        if old is None or _looks(old) != _looks(new):
            self._draw(new)
        if self._cloud is not None:
            shown = "depth map" not in new.session.view.hidden_layers
            if self._cloud.visible != shown:
                self._cloud.visible = shown

    def _draw(self, state: State) -> None:
        if self._cloud is not None:
            self._cloud.remove()
            self._cloud = None
        scene = state.session.scene
        if scene is None:
            return
        scan = scene.depth_map
        left = unexplained(scene) if _parts_shown(state) else np.ones(scan.elevation.shape, dtype=bool)
        said = _residuals_shown(state)
        if said is not None:
            left = left & ~cells_of(scan, said.readings_world)
        stride = stride_of(scan)
        points, elevation = thinned(scan, left, stride)
        self._cloud = self._server.scene.add_point_cloud(
            "/depth_map",
            scaled(points),
            elevation_colours(elevation / elevation_span(scan)),
            point_size=float(scaled(scan.cell * stride * 1.1)),
            point_shape="square",
            precision="float32",
            point_shading="flat",
        )


def _parts_shown(state: State) -> bool:
    """Whether located parts stand as solids; while a hypothesis is looked at, the readings beneath them are wanted."""
    return "located parts" not in state.session.view.hidden_layers and state.hypothesis is None


def _residuals_shown(state: State) -> Explanation | None:
    """The explanation whose readings stand in the scene in colours of their own."""
    return None if "residuals" in state.session.view.hidden_layers else state.explanation


def _looks(state: State) -> tuple:
    return id(state.session.scene), _parts_shown(state), id(_residuals_shown(state))


def stride_of(scan: DepthMap) -> int:
    """Every how-many-th cell is shown, so that a slow browser copes."""
    return int(np.ceil(np.sqrt(max(1.0, scan.elevation.size / MAX_POINTS))))


def thinned(scan: DepthMap, left: NDArray, stride: int) -> tuple[NDArray, NDArray]:
    """Points (n, 3) [m] in the world and their elevations (n,) [m], of every `stride`-th cell that is `left`."""
    grid = scan.elevation[::stride, ::stride]
    j, i = np.nonzero(np.isfinite(grid) & left[::stride, ::stride])
    points = np.c_[(i * stride + 0.5) * scan.cell, (j * stride + 0.5) * scan.cell, grid[j, i]]
    return points @ scan.T_world_range[:3, :3].T + scan.T_world_range[:3, 3], grid[j, i]


def elevation_span(scan: DepthMap) -> float:
    """The elevation [m] at the upper end of the colour scale."""
    seen = scan.elevation[np.isfinite(scan.elevation)]
    highest = float(np.percentile(seen, 99.9)) if len(seen) else 0.0
    return max(MIN_SPAN_M, np.ceil(highest / 0.01) * 0.01)
