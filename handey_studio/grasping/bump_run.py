"""What a run of the grasp approach planner tells (Handey 1987 §5.2, Figures 9 and 10)."""

from dataclasses import dataclass, replace
from typing import Literal

from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.grasping.grasp_plane import GraspPlane

Status = Literal["reached", "stuck", "iterations", "blocked start", "short contact", "no way"]
FoundBy = Literal["bump lines", "another start", "plane search", "straight back", ""]


@dataclass(frozen=True, eq=False)
class BumpIterations(Value):
    """What the planner saw and did, iteration by iteration: the hand's `poses` (k, 3), which bump lines (k, m) were `colliding`, how many
    steps the hand might move along each bump vector (`multipliers`), the `free` motion vectors (k, 2), and by which `rules` (k,) it moved:
    0 the scaled combination, 1 a stairstep, 2 a turn on the spot."""

    poses: NDArray
    colliding: NDArray
    multipliers: NDArray
    free: NDArray
    rules: NDArray

    def __post_init__(self) -> None:
        for key, dtype in (("poses", float), ("colliding", bool), ("multipliers", float), ("free", float), ("rules", int)):
            object.__setattr__(self, key, frozen_array(getattr(self, key), dtype))


@dataclass(frozen=True, eq=False)
class BumpRun(Value):
    """One run of the planner. `path` (k, 3): fingertip point y, z [m] and angle [rad] in the grasp plane, start first.

    `status`: reached, stuck (no motion is left), iterations (the limit was hit), blocked start, short contact (it ended with too little
    overlap of finger and face), or no way (not even a search of all motions finds one). `distance` [m] is what remained, and `threshold`
    [m] what had to be come under. `found_by` says what it took. `iterations` tell how the bump lines led the hand; where a search found the
    path they are those of the run that came nearest.
    """

    plane: GraspPlane
    path: NDArray
    goal: NDArray
    status: Status
    distance: float
    threshold: float = 0.0
    found_by: FoundBy = ""
    iterations: BumpIterations | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", frozen_array(self.path))
        object.__setattr__(self, "goal", frozen_array(self.goal))

    def reversed(self) -> "BumpRun":
        """The same the other way round; the iterations stay as they were."""
        return replace(self, path=self.path[::-1], goal=self.path[0, :2])
