"""Browsing what the localizer weighed: which hypotheses are listed, which page of them, which data edges are shown."""

from handey_studio.app.state import State
from handey_studio.session.looking import browsed

ROWS = 6  # hypotheses on a page of the list


def browsed_hypotheses(state: State) -> tuple[int, ...]:
    """Numbers of the hypotheses that the filter leaves, best first."""
    return browsed(state.session.scene, state.hypothesis_part, state.hypothesis_verdict)


def page_of(state: State) -> tuple[int, ...]:
    """The page of them that holds the one that is looked at, or the first."""
    listed, now = browsed_hypotheses(state), state.session.view.hypothesis
    first = ROWS * (listed.index(now) // ROWS) if now in listed else 0
    return listed[first : first + ROWS]


def wired(state: State) -> tuple[int, ...]:
    """The hypotheses that stand in the scene as wires: all that are listed, while one is looked at."""
    hidden = state.session.view.hidden_layers
    if state.hypothesis is None or "other hypotheses" in hidden:
        return ()
    return browsed_hypotheses(state)


def edges_shown(state: State) -> list[int]:
    """Numbers of the data edges that are long enough to be shown."""
    scene = state.session.scene
    if scene is None or "data edges" in state.session.view.hidden_layers:
        return []
    return [number for number, edge in enumerate(scene.located.edges) if edge.length >= state.edge_min_m]
