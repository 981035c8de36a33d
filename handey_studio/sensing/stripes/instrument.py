"""A range finder as calibrated: cameras, the plane of light of each photograph, and how the rig moved between them.

The simulated `RangeFinder` is one of these too: its cameras, its planes. So one scan serves both.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.geometry.transforms import is_rigid
from handey_studio.sensing.stripes.range_finder import RangeFinder
from handey_studio.sensing.stripes.stripe_camera import StripeCamera

MAX_SIDE_CELLS = 4096
MIN_CELL_M, MAX_CELL_M = 0.0001, 0.02


@dataclass(frozen=True, eq=False)
class Instrument(Value):
    """Cameras and laser planes in the rig's frame, which is the range frame unless the rig moves. Metres.

    `names` (one a camera) begin the names of that camera's photographs; a single camera may be called "". `planes` (n, 4) hold
    n·p = d: one for all photographs, or one for each in the order of their names. `laser` (3,) is the source of light, if known. `rig`
    (m, 4, 4) holds T_range_rig of each photograph, `rig_step` (4, 4) the transform that each adds to the one before; neither is a rig
    at rest. Without `area` (x, y) the depth map spans the readings, and its origin moves to their corner.
    """

    cameras: tuple[StripeCamera, ...]
    names: tuple[str, ...]
    planes: NDArray
    laser: NDArray | None = None
    rig: NDArray | None = None
    rig_step: NDArray | None = None
    T_world_range: NDArray = field(default_factory=lambda: np.eye(4))
    area: tuple[float, float] | None = None
    cell: float = 0.001
    max_height: float = 1.0

    def __post_init__(self) -> None:
        for key in ("planes", "laser", "rig", "rig_step", "T_world_range"):
            if getattr(self, key) is not None:
                object.__setattr__(self, key, frozen_array(getattr(self, key)))
        if not self.cameras or len(self.names) != len(self.cameras) or len(set(self.names)) != len(self.names):
            raise BadInput(f"a range finder needs at least one camera, each with a name of its own; it has {list(self.names)}.")
        if self.planes.ndim != 2 or self.planes.shape[1] != 4 or not len(self.planes) or not np.isfinite(self.planes).all():
            raise BadInput(f"laser planes are rows of four finite numbers nx, ny, nz, d; they have the shape {self.planes.shape}.")
        if np.abs(np.linalg.norm(self.planes[:, :3], axis=1) - 1.0).max() > 1e-6:
            raise BadInput("the normal of a laser plane must have length 1.")
        self._check_transforms()
        self._check_area()

    def _check_transforms(self) -> None:
        if self.rig is not None and self.rig_step is not None:
            raise BadInput("the rig moves by a step or by poses, not by both.")
        steps = () if self.rig_step is None else (self.rig_step,)
        for T in (self.T_world_range, *steps, *(() if self.rig is None else self.rig)):
            if not is_rigid(T, 1e-5):
                raise BadInput("T_world_range and the rig's step and poses must be rigid 4×4 transforms: a proper rotation, metres.")

    def _check_area(self) -> None:
        if not MIN_CELL_M <= self.cell <= MAX_CELL_M or not 0 < self.max_height <= 10.0:
            limits = f"{MIN_CELL_M:g}–{MAX_CELL_M:g} m and up to 10 m"
            raise BadInput(f"cells of {self.cell} m and a height of {self.max_height} m are not usable; they take {limits}.")
        sides = self.area or (self.cell, self.cell)
        if not all(self.cell <= side <= MAX_SIDE_CELLS * self.cell for side in sides):
            raise BadInput(f"an area of {sides} m in cells of {self.cell} m: a side takes one cell to {MAX_SIDE_CELLS}.")

    def planes_of(self, count: int) -> NDArray:
        """The plane (count, 4) of each of a camera's photographs, in the rig's frame. Raises BadInput when the counts differ."""
        if len(self.planes) == 1:
            return np.repeat(self.planes, count, axis=0)
        if len(self.planes) != count:
            raise BadInput(f"there are {count} photographs for {len(self.planes)} laser planes; each photograph has its plane.")
        return self.planes

    def rig_of(self, count: int) -> NDArray:
        """T_range_rig (count, 4, 4) of each of a camera's photographs. Raises BadInput when the counts differ."""
        if self.rig is not None:
            if len(self.rig) != count:
                raise BadInput(f"there are {count} photographs for {len(self.rig)} poses of the rig; each photograph has its pose.")
            return self.rig
        Ts = np.repeat(np.eye(4)[None], count, axis=0)
        if self.rig_step is not None:
            for k in range(1, count):
                Ts[k] = Ts[k - 1] @ self.rig_step
        return Ts


def instrument_of(finder: RangeFinder) -> Instrument:
    """A range finder of the simulated cell as an instrument: the same cameras, planes and grid."""
    return Instrument(
        cameras=finder.cameras,
        names=tuple(f"camera{k}" for k in range(len(finder.cameras))),
        planes=finder.laser_planes,
        laser=finder.laser,
        T_world_range=finder.T_world_range,
        area=finder.area,
        cell=finder.cell,
        max_height=finder.max_height,
    )
