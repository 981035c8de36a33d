"""What every tool of the modeller uses: their names, a click more, another tool."""

from dataclasses import replace

import numpy as np

from handey_studio.app.modelling.look import SELECT
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.modeling.picking.snap import Snap

BOX, SKETCH, EXTRUDE, CUT, MIRROR, MEASURE = "box", "sketch", "extrude", "cut", "mirror", "measure"
SAME_M = 5e-4  # clicks nearer than this are one


def with_tool(state: State, tool: str = SELECT) -> State:
    """Another tool, with nothing clicked yet."""
    return replace(state, model=replace(state.model, tool=tool, clicks=(), drawing=None, picked=()))


def with_click(state: State, snap: Snap) -> State:
    """One click more of the active tool."""
    return replace(state, model=replace(state.model, clicks=(*state.model.clicks, snap)))


def check_apart(clicks: tuple[Snap, ...]) -> None:
    """Raises BadInput when a click is on the one before it."""
    if len(clicks) > 1 and np.linalg.norm(clicks[-1].point - clicks[-2].point) < SAME_M:
        raise BadInput("this click is on the one before; click another place.")
