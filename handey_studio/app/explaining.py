"""Explains the hypothesis that is looked at, away from the loop: one look at a large scan takes a moment."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from handey_studio.app.background import Background
from handey_studio.app.state import Explained, State
from handey_studio.session.looking import explained


@dataclass(frozen=True, eq=False)
class Explain:
    """Hypothesis `number` of a scene was explained."""

    said: Explained

    def apply(self, state: State) -> State:
        return replace(state, explained=self.said)


class Explainer(Background):
    """Explains one hypothesis after the other."""

    def __init__(self, send: Callable[[Any], None]) -> None:
        super().__init__(send, _wanted, explained, lambda asked, said: Explain(Explained(asked[0], asked[2], said)))


def _wanted(state: State) -> tuple | None:
    scene = state.session.scene
    return None if scene is None or state.hypothesis is None else (scene, state.session.parts, state.session.view.hypothesis)
