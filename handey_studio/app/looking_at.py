"""Looking at what was found: hypotheses, data edges, layers of the scene. Looking is no edit."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.app.browsing import browsed_hypotheses, edges_shown, page_of, wired
from handey_studio.app.ruler import laid
from handey_studio.app.state import State, with_view
from handey_studio.session.looking import edge_at, hypotheses_at


@dataclass(frozen=True)
class LookAt:
    """Look at one hypothesis, and at no single edge beside its own; -1 for none."""

    number: int

    def apply(self, state: State) -> State:
        count = len(state.session.scene.located.hypotheses) if state.session.scene else 0
        return with_view(state, hypothesis=self.number if 0 <= self.number < count else -1, edge=-1)


@dataclass(frozen=True)
class Browse:
    """Look at the hypothesis so many places further down the list; past its end it begins again."""

    by: int

    def apply(self, state: State) -> State:
        listed = browsed_hypotheses(state)
        if not listed:
            return state.told("There is no hypothesis to look at yet; Plan or MOVE scans the table first.")
        now = state.session.view.hypothesis
        place = listed.index(now) + self.by if now in listed else (0 if self.by > 0 else -1)
        return LookAt(listed[place % len(listed)]).apply(state)


@dataclass(frozen=True)
class BrowseRow:
    """Look at the hypothesis in this row of the list, or no longer, if it is the one that is looked at."""

    row: int

    def apply(self, state: State) -> State:
        listed = page_of(state)
        if self.row >= len(listed):
            return state
        number = listed[self.row]
        return LookAt(-1 if number == state.session.view.hypothesis else number).apply(state)


@dataclass(frozen=True)
class FilterHypotheses:
    """List only those of a part, or with a verdict; an empty word is for all."""

    part: str | None = None
    verdict: str | None = None

    def apply(self, state: State) -> State:
        part = state.hypothesis_part if self.part is None else self.part
        verdict = state.hypothesis_verdict if self.verdict is None else self.verdict
        state = replace(state, hypothesis_part=part, hypothesis_verdict=verdict)
        listed = browsed_hypotheses(state)
        looked_at = state.session.view.hypothesis
        return state if looked_at < 0 or looked_at in listed else LookAt(listed[0] if listed else -1).apply(state)


@dataclass(frozen=True)
class FilterEdges:
    """Show only data edges at least so long [m]."""

    min_m: float

    def apply(self, state: State) -> State:
        state = replace(state, edge_min_m=max(0.0, self.min_m))
        return state if state.session.view.edge in (-1, *edges_shown(state)) else Select("edge", -1).apply(state)


@dataclass(frozen=True)
class ShowLayer:
    layer: str
    shown: bool

    def apply(self, state: State) -> State:
        hidden = tuple(layer for layer in state.session.view.hidden_layers if layer != self.layer)
        return with_view(state, hidden_layers=hidden if self.shown else (*hidden, self.layer))


@dataclass(frozen=True)
class ToggleLayer:
    """Show what is hidden, hide what is shown."""

    layer: str

    def apply(self, state: State) -> State:
        return ShowLayer(self.layer, self.layer in state.session.view.hidden_layers).apply(state)


@dataclass(frozen=True)
class SetDark:
    """Show the page light on dark, or dark on light."""

    dark: bool

    def apply(self, state: State) -> State:
        return replace(state, dark=self.dark)


@dataclass(frozen=True)
class Select:
    """Look at one data edge or result; -1 for none (the last result)."""

    kind: str
    number: int

    def apply(self, state: State) -> State:
        if self.kind == "result":
            state = with_view(state, time_s=0.0, attempt=0)
        return with_view(state, **{self.kind: self.number})


@dataclass(frozen=True, eq=False)
class PointAt:
    """A click into the scene along a ray: it looks at the hypothesis or else the data edge there, if one is shown there, or lays the ruler.

    Where several hypotheses have their wires, each further click looks at the next of them.
    """

    origin: NDArray
    direction: NDArray

    def apply(self, state: State) -> State:
        session = state.session
        if state.ruler is not None and not state.modelling:
            return laid(state, self.origin, self.direction)
        if session.scene is None or state.modelling:
            return state
        there = hypotheses_at(session.scene, session.parts, wired(state), self.origin, self.direction)
        if there:
            now = session.view.hypothesis
            return LookAt(there[(there.index(now) + 1) % len(there)] if now in there else there[0]).apply(state)
        shown = edges_shown(state)
        found = edge_at([session.scene.located.edges[k] for k in shown], self.origin, self.direction)
        return state if found < 0 else Select("edge", shown[found]).apply(state)


@dataclass(frozen=True, eq=False)
class CameraMoved:
    """A browser's camera stands here (3,) and looks there (3,) [m]; kept so that reopening shows the same view."""

    position: NDArray
    look_at: NDArray

    def apply(self, state: State) -> State:
        if not (np.isfinite(self.position).all() and np.isfinite(self.look_at).all()):
            return state
        return with_view(state, camera_position=self.position, camera_look_at=self.look_at)
