"""What the scene of the MOVE shows while a model is open: nothing."""

from dataclasses import replace
from functools import lru_cache

from handey_studio.app.state import State
from handey_studio.session import LAYERS
from handey_studio.session.ledger_tree import ROOT


@lru_cache(maxsize=4)
def _emptied(state: State) -> State:
    session = state.session
    view = replace(session.view, hidden_layers=LAYERS, hypothesis=-1, edge=-1, result=-1)
    return replace(state, session=replace(session, scene=None, results=(), commands=(), view=view), ledger_entry=ROOT)


def aside(state: State) -> State:
    """The state itself, or while a model is open one of which the MOVE's scene shows nothing but what it looks up in `State.model`."""
    return _emptied(state) if state.modelling else state
