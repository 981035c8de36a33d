"""The state of a model between two steps of its history."""

from dataclasses import dataclass, fields, replace
from typing import Any

from numpy.typing import NDArray

from handey_studio.base import Value
from handey_studio.geometry import Polyhedron
from handey_studio.modeling.outline import Outline

Maker = tuple[int, int]


@dataclass(frozen=True, eq=False)
class PlacedOutline(Value):
    """A sketch: an outline in the x and y of a plane, `T_model_plane` (4, 4)."""

    name: str
    T_model_plane: NDArray
    outline: Outline


@dataclass(frozen=True, eq=False)
class State(Value):
    """What the steps so far have made, in the model's frame.

    `sources` tells of each face of the solid where it comes from: "seen in …", "assumed: …", "drawn: box". `makers` names for each
    face the step that made it and which of that step's faces it was, so that a face can be followed through later steps.
    `poses`: (scan's name, T_model_scan) of the scans whose pose is known; `scans` names all of them; `count` the steps so far.
    """

    solid: Polyhedron | None = None
    sources: tuple[str, ...] = ()
    makers: tuple[Maker, ...] = ()
    sketches: tuple[PlacedOutline, ...] = ()
    scans: tuple[str, ...] = ()
    poses: tuple[tuple[str, NDArray], ...] = ()
    count: int = 0

    @property
    def fields(self) -> dict[str, Any]:
        """The state's own fields by name."""
        return {f.name: getattr(self, f.name) for f in fields(State)}

    @property
    def Ts_model_scan(self) -> dict[str, NDArray]:
        """The poses (4, 4) of the scans that are aligned, by name."""
        return dict(self.poses)

    @property
    def state(self) -> "State":
        """The bare state, without what a `Built` adds."""
        return State(**self.fields)

    def after_step(self) -> "State":
        """The same, one step later."""
        return replace(self, count=self.count + 1)
