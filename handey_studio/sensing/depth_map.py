"""The depth map (Handey 1987 §3): a grid of elevations over the table, built by the range finder."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.geometry.transforms import transform
from handey_studio.sensing.depth_view import DepthView, Orthographic

SKY_M = 10.0  # higher than anything that a map holds
VIEW_HEIGHT_M = 1.0  # the orthographic view's origin sits this far above the range frame; any height above the pile serves


@dataclass(frozen=True, eq=False)
class DepthMap(Value):
    """Elevations (ny, nx) [m] above z = 0 of the range frame, NaN where nothing was read; the highest surface wins.

    Cell (j, i) covers x in [i, i + 1)·cell and y in [j, j + 1)·cell of the range frame. `passed` (ny, nx) [m] is the lowest height
    above each cell that light on its way to a reading, or from it to a camera, went through: the space above it is empty. It is the
    elevation itself where there is one, and `SKY_M` where no such light passed. The rest as in `DepthView`.
    """

    elevation: NDArray
    cell: float
    T_world_range: NDArray
    passed: NDArray
    noise: float = 0.0005
    outline_error: float = 0.001
    rim_px: float = 0.5

    def __post_init__(self) -> None:
        for key in ("elevation", "T_world_range", "passed"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))

    def view(self) -> DepthView:
        """The map as an image, seen from above by parallel light; row 0 is the far side, y = ny·cell."""
        ny = len(self.elevation)
        T_range_sensor = transform(np.diag([1.0, -1.0, -1.0]), (0.0, ny * self.cell, VIEW_HEIGHT_M))
        return DepthView(
            VIEW_HEIGHT_M - self.elevation[::-1],
            Orthographic(self.cell, -0.5, -0.5),
            self.T_world_range @ T_range_sensor,
            self.noise,
            self.outline_error,
            self.rim_px,
        )

    def points_world(self) -> NDArray:
        """The readings (n, 3) [m], one a cell at its centre."""
        j, i = np.nonzero(np.isfinite(self.elevation))
        points = np.c_[(i + 0.5) * self.cell, (j + 0.5) * self.cell, self.elevation[j, i]]
        return points @ self.T_world_range[:3, :3].T + self.T_world_range[:3, 3]
