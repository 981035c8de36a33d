"""The ruler: two spots clicked in the scene, and how far they are apart. Measuring is no edit."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.app.setting_up import ChoosePart
from handey_studio.app.state import State
from handey_studio.session.ruler import spot_at

HOW = "Click two spots in the scene: corners of parts, readings, the table."


@dataclass(frozen=True)
class ToggleRuler:
    """Take the ruler up, or put it away."""

    def apply(self, state: State) -> State:
        return replace(state, ruler=() if state.ruler is None else None)


@dataclass(frozen=True)
class ClickPart:
    """A click on a part in the scene chooses it for the MOVE, unless the ruler is in hand."""

    part: str

    def apply(self, state: State) -> State:
        return ChoosePart(self.part).apply(state) if state.ruler is None else state


def laid(state: State, origin: NDArray, direction: NDArray) -> State:
    """The ruler laid to where a ray (origin (3,) [m], direction (3,)) points at; a third spot begins anew."""
    spot = spot_at(state.session.scene, state.session.workcell.table_z, origin, direction)
    if spot is None or state.ruler is None:
        return state
    before = state.ruler if len(state.ruler) == 1 else ()
    return replace(state, ruler=(*before, spot))


def ruler_words(spots: tuple[NDArray, ...]) -> str:
    """What the ruler tells."""
    if not spots:
        return HOW
    here = f"{_coordinates(spots[-1])} mm"
    if len(spots) == 1:
        return f"At {here}. Click another spot."
    apart = spots[1] - spots[0]
    return f"{1e3 * np.linalg.norm(apart):.1f} mm apart: {_coordinates(apart)} mm in x, y, z. The second spot is at {here}."


def _coordinates(point: NDArray) -> str:
    return ", ".join(f"{round(1e3 * float(value), 1) + 0.0:.1f}" for value in point)
