"""A height field: the space that is taken for solid, column by column."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handey_studio.base import Value, frozen_array


@dataclass(frozen=True, eq=False)
class HeightField(Value):
    """Columns that are solid from far below up to `top`.

    `top` (ny, nx) [m] above z = 0 of the range frame; column (j, i) covers x in [i, i + 1)·cell and y in [j, j + 1)·cell of that
    frame. `T_world_range` has its z axis along world z.
    """

    top: NDArray
    cell: float
    T_world_range: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "top", frozen_array(self.top))
        object.__setattr__(self, "T_world_range", frozen_array(self.T_world_range))

    @property
    def size(self) -> tuple[float, float]:
        """Extent along the range frame's x and y [m]."""
        return self.top.shape[1] * self.cell, self.top.shape[0] * self.cell

    def indices(self, points_range: ArrayLike) -> tuple[NDArray, NDArray, NDArray]:
        """Row, column and whether inside, of points (..., 2 or 3) [m] in the range frame."""
        points = np.asarray(points_range, dtype=float)
        i = np.floor(points[..., 0] / self.cell).astype(int)
        j = np.floor(points[..., 1] / self.cell).astype(int)
        inside = (i >= 0) & (j >= 0) & (i < self.top.shape[1]) & (j < self.top.shape[0])
        return np.clip(j, 0, self.top.shape[0] - 1), np.clip(i, 0, self.top.shape[1] - 1), inside

    def coarsened(self, factor: int) -> "HeightField":
        """Blocks of factor × factor columns made one, as high as their highest: nothing solid is lost."""
        ny, nx = (-(-n // factor) * factor for n in self.top.shape)
        padded = np.full((ny, nx), -np.inf)
        padded[: self.top.shape[0], : self.top.shape[1]] = self.top
        strips = padded.reshape(ny // factor, factor, nx).max(axis=1)
        return HeightField(strips.reshape(ny // factor, nx // factor, factor).max(axis=2), self.cell * factor, self.T_world_range)
