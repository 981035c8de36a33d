"""The one thing that Enter and the blue button do: what is offered is taken, or the tool does its work. And Esc: less of it."""

from dataclasses import dataclass, replace

from handey_studio.app.actions import Bench, CancelMove
from handey_studio.app.modelling import derived
from handey_studio.app.modelling.importing import LeaveMesh
from handey_studio.app.modelling.look import POINTS, SELECT
from handey_studio.app.modelling.steps import AcceptAlignment, TakeModel
from handey_studio.app.modelling.tool_clicks import CUT, EXTRUDE, MIRROR, SKETCH, with_tool
from handey_studio.app.modelling.tools import FINISHED, FinishTool
from handey_studio.app.state import State
from handey_studio.session.model_look import proposals

TOOL_LABELS = {SKETCH: "Close the outline", EXTRUDE: "Extrude", CUT: "Cut", MIRROR: "Mirror it", POINTS: "Align by these points"}


@dataclass(frozen=True)
class Accept:
    """What is offered is taken, or the active tool does its work."""

    def apply(self, state: State) -> State:
        if derived.draft_of(state) is None:
            return state
        if state.model.trial is not None:
            return replace(state, model=replace(state.model, trial=None))
        if state.model.tool != SELECT:
            return FinishTool().apply(state)
        if proposals(derived.alignment(state)):
            return AcceptAlignment().apply(state)
        found = derived.suggestion(state)
        return TakeModel().apply(state) if found is not None and found.solid is not None else state


@dataclass(frozen=True)
class Escape:
    """A job is stopped; else the ruler is put away, or the scan in which the model was looked for; else the tool is put down; else nothing
    is selected."""

    def run(self, bench: Bench) -> State:
        state = bench.state
        if state.job is not None:
            return CancelMove().run(bench)
        if state.model.mesh is not None:
            return LeaveMesh().apply(state)
        if not state.model.open:
            return replace(state, ruler=None)
        if state.model.trial is not None:
            return replace(state, model=replace(state.model, trial=None))
        if state.model.clicks or state.model.drawing is not None:
            return replace(state, model=replace(state.model, clicks=(), drawing=None))
        return with_tool(replace(state, model=replace(state.model, step=None, check=-1)))


def accept_label(state: State) -> str:
    """What the blue button does now; empty when there is nothing to accept."""
    if derived.draft_of(state) is None or state.job is not None:
        return ""
    if state.model.trial is not None:
        return "Back to the model"
    if state.model.tool != SELECT:
        return TOOL_LABELS.get(state.model.tool, "") if state.model.tool in FINISHED else ""
    if proposals(derived.alignment(state)):
        return "Accept this alignment"
    found = derived.suggestion(state)
    return "Take this model" if found is not None and found.solid is not None else ""
