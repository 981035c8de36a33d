"""The tools that draw: a box from three clicks, a sketch by its corners, the last sketch drawn out."""

from dataclasses import replace

from handey_studio.app.modelling.derived import built, scene_to_click
from handey_studio.app.modelling.look import BY_HEIGHT, TO_FACE, Drawing
from handey_studio.app.modelling.steps import operated
from handey_studio.app.modelling.tool_clicks import EXTRUDE, check_apart, with_click, with_tool
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.modeling.operations import Extrude, Sketch
from handey_studio.modeling.picking.snap import Ray, Snap
from handey_studio.modeling.references import FaceAt
from handey_studio.modeling.sketching import SketchOptions, clicked, closed
from handey_studio.session.strokes import box_of, guides_of, on_model, on_plane, plane_of, sketch_frame


def box_clicked(state: State, snap: Snap) -> State:
    state = with_click(state, snap)
    if len(state.model.clicks) < 3:
        check_apart(state.model.clicks)
        return state
    settings = state.model.settings
    depth = settings.height if settings.far == BY_HEIGHT else None
    return operated(state, box_of(state.model.clicks, state.model.eye, depth, settings.combine))


def sketch_clicked(state: State, snap: Snap) -> State:
    scene = scene_to_click(state)
    if scene is None:
        return state
    T = sketch_frame(snap, scene)
    on = on_model(snap)
    drawing = Drawing(T, on if isinstance(on, FaceAt) else None, guides_of(scene, T))
    return replace(state, model=replace(state.model, drawing=drawing))


def drawn(state: State, ray: Ray) -> State:
    """One more corner of the sketch; a click on the first one closes it, and it is ready to be extruded."""
    drawing = state.model.drawing
    if drawing is None:
        return state
    xy = on_plane(ray.origin, ray.direction, drawing.T_model_plane)
    options = SketchOptions(infer=state.model.settings.infer)
    drawing = replace(drawing, stroke=clicked(drawing.stroke, xy, drawing.guides, options))
    state = replace(state, model=replace(state.model, drawing=drawing))
    return _sketched(state, drawing) if drawing.stroke.closed else state


def close_sketch(state: State) -> State:
    drawing = state.model.drawing
    if drawing is None:
        raise BadInput("click a face or the support to draw on first.")
    drawing = replace(drawing, stroke=closed(drawing.stroke, drawing.guides, SketchOptions(infer=state.model.settings.infer)))
    return _sketched(state, drawing)


def _sketched(state: State, drawing: Drawing) -> State:
    shown = built(state)
    number = 1 + (len(shown.sketches) if shown is not None else 0)
    step = Sketch(f"sketch {number}", drawing.T_model_plane, drawing.stroke.outline, drawing.on)
    return with_tool(operated(state, step), EXTRUDE)


def extrude_clicked(state: State, snap: Snap) -> State:
    """A click on a face says how far, when that is what is asked for."""
    if state.model.settings.far != TO_FACE:
        return state
    point, normal = plane_of(snap)
    return _extruded(state, FaceAt(point, normal))


def extrude(state: State) -> State:
    if state.model.settings.far == TO_FACE:
        raise BadInput("click the face or patch that the extrusion goes to.")
    return _extruded(state, None)


def _extruded(state: State, to: FaceAt | None) -> State:
    shown, settings = built(state), state.model.settings
    if shown is None or not shown.sketches:
        raise BadInput("there is no sketch to extrude; draw one first.")
    height = settings.height if settings.far == BY_HEIGHT else None
    return operated(state, Extrude(shown.sketches[-1].name, height, to, settings.combine))
