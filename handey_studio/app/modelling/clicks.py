"""Taking back single clicks of a tool that is not done yet."""

from dataclasses import replace

from handey_studio.app.state import State
from handey_studio.modeling.sketching import undone


def click_taken_back(state: State) -> State | None:
    """The state before the active tool's last click; None where it has none."""
    look = state.model
    if not look.open:
        return None
    if look.drawing is not None:
        if not len(look.drawing.stroke.clicks):
            return replace(state, model=replace(look, drawing=None))
        return replace(state, model=replace(look, drawing=replace(look.drawing, stroke=undone(look.drawing.stroke))))
    return replace(state, model=replace(look, clicks=look.clicks[:-1])) if look.clicks else None
