"""The tools of the modeller as commands: a click into the scene, another tool, what is set beside it, its work."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from handey_studio.app.modelling.derived import built, draft_of, scene_to_click, wants_suggestion
from handey_studio.app.modelling.drawing_tools import box_clicked, close_sketch, drawn, extrude, extrude_clicked, sketch_clicked
from handey_studio.app.modelling.look import POINTS, SELECT
from handey_studio.app.modelling.plane_tools import cut, measure_clicked, mirrored, plane_clicked
from handey_studio.app.modelling.selecting import aligned_by_points, points_clicked, selected
from handey_studio.app.modelling.showing import look_at_scans
from handey_studio.app.modelling.tool_clicks import BOX, CUT, EXTRUDE, MEASURE, MIRROR, SKETCH, with_tool
from handey_studio.app.state import State
from handey_studio.modeling.picking.snap import Ray, Snap, SnapOptions
from handey_studio.modeling.picking.snapping import pick
from handey_studio.session.model_look import unaligned


@dataclass(frozen=True, eq=False)
class ClickScene:
    """A click into the scene along a line of sight; with `add` it selects one thing more."""

    ray: Ray
    add: bool = False

    def apply(self, state: State) -> State:
        scene = scene_to_click(state)
        if scene is None:
            return state
        state = replace(state, model=replace(state.model, eye=self.ray.origin))
        snap = pick(scene, self.ray, _snap_options(state))
        if state.model.tool == SELECT:
            return selected(state, snap, self.add)
        if state.model.drawing is not None:
            return drawn(state, self.ray)
        return state if snap is None else CLICKED[state.model.tool](state, snap)


@dataclass(frozen=True)
class ChooseTool:
    """Another tool, with nothing clicked yet. To pick points on two scans, every camera goes where it sees both."""

    tool: str

    def run(self, bench: Any) -> State:
        state = with_tool(bench.state, self.tool)
        if self.tool == POINTS:
            look_at_scans(bench, state)
        return state


@dataclass(frozen=True)
class SetTool:
    """A value beside the tools was set: `name` as in `ToolSettings`."""

    name: str
    value: object

    def apply(self, state: State) -> State:
        settings = replace(state.model.settings, **{self.name: self.value})
        return replace(state, model=replace(state.model, settings=settings))


@dataclass(frozen=True)
class FinishTool:
    """The tool does its work with what it has."""

    def apply(self, state: State) -> State:
        return FINISHED[state.model.tool](state) if state.model.tool in FINISHED else state


def _snap_options(state: State) -> SnapOptions:
    """Planes are what some tools are about; others look for corners and edges first. A model is selected through its scans."""
    draft, shown = draft_of(state), built(state)
    if state.model.tool == SELECT and draft is not None and shown is not None and shown.solid is not None:
        return SnapOptions(scans=None if wants_suggestion(draft) or unaligned(draft) is not None else ())
    planes_first = state.model.tool == EXTRUDE or (state.model.tool == SKETCH and state.model.drawing is None)
    return SnapOptions(kinds=("plane",)) if planes_first else SnapOptions()


CLICKED: dict[str, Callable[[State, Snap], State]] = {
    BOX: box_clicked,
    SKETCH: sketch_clicked,
    EXTRUDE: extrude_clicked,
    CUT: plane_clicked,
    MIRROR: plane_clicked,
    MEASURE: measure_clicked,
    POINTS: points_clicked,
}
FINISHED: dict[str, Callable[[State], State]] = {
    SKETCH: close_sketch,
    EXTRUDE: extrude,
    CUT: cut,
    MIRROR: mirrored,
    POINTS: aligned_by_points,
}
