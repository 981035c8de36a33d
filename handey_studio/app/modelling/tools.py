"""The tools of the modeller: which are there, what a click means to each, and when it has all that it needs."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.app.modelling.derived import built, draft_of, found_patches, scan_poses, scene_to_click, wants_suggestion
from handey_studio.app.modelling.look import BY_HEIGHT, SELECT, TO_FACE, Drawing
from handey_studio.app.modelling.steps import operated
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.modeling.measuring import Measurement, measure
from handey_studio.modeling.operations import CutByPlane, Extrude, Mirror, Sketch
from handey_studio.modeling.references import FaceAt
from handey_studio.modeling.sketching import SketchOptions, clicked, closed
from handey_studio.modeling.snap import MODEL, Ray, Snap, SnapOptions
from handey_studio.modeling.snapping import pick
from handey_studio.modeling.taking import reference_of
from handey_studio.session.model_look import unaligned
from handey_studio.session.strokes import box_of, guides_of, on_model, on_plane, pixel_of, plane_normal, plane_of, sketch_frame

BOX, SKETCH, EXTRUDE, CUT, MIRROR, MEASURE, POINTS = "box", "sketch", "extrude", "cut", "mirror", "measure", "align"


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
            return _selected(state, snap, self.add)
        if state.model.drawing is not None:
            return _drawn(state, self.ray)
        return state if snap is None else CLICKED[state.model.tool](state, snap)


@dataclass(frozen=True)
class ChooseTool:
    """Another tool, with nothing clicked yet."""

    tool: str

    def apply(self, state: State) -> State:
        return replace(state, model=replace(state.model, tool=self.tool, clicks=(), drawing=None, picked=()))


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


def back_to_select(state: State) -> State:
    """The tool is put down."""
    return ChooseTool(SELECT).apply(state)


def _snap_options(state: State) -> SnapOptions:
    """Planes are what some tools are about; others look for corners and edges first. A model is selected through its scans."""
    draft, shown = draft_of(state), built(state)
    if state.model.tool == SELECT and draft is not None and shown is not None and shown.solid is not None:
        return SnapOptions(scans=None if wants_suggestion(draft) or unaligned(draft) is not None else ())
    planes_first = state.model.tool == EXTRUDE or (state.model.tool == SKETCH and state.model.drawing is None)
    return SnapOptions(kinds=("plane",)) if planes_first else SnapOptions()


def _selected(state: State, snap: Snap | None, add: bool) -> State:
    """What was clicked is selected; of a scan that is still to be modelled, its object is."""
    draft = draft_of(state)
    new = unaligned(draft) if draft is not None else None
    if snap is not None and draft is not None and new is not None and snap.owner >= 0 and draft.scans[snap.owner] is new:
        return _new_object(state, snap)
    if snap is not None and snap.owner != MODEL and draft is not None and wants_suggestion(draft):
        at = pixel_of(draft.scans[snap.owner], scan_poses(state)[snap.owner], snap.point)
        return replace(state, model=replace(state.model, object_at=(snap.owner, *at), picked=()))
    picked = () if snap is None else ((*state.model.picked[-1:], snap) if add else (snap,))
    return replace(state, model=replace(state.model, picked=picked))


def _new_object(state: State, snap: Snap) -> State:
    """Of the scan that is not aligned yet, the object that was clicked is the one that is modelled."""
    patches = found_patches(state)[snap.owner]
    if patches is None or not 0 <= snap.number < len(patches.patches):
        return state
    return replace(state, model=replace(state.model, new_object=patches.patches[snap.number].object, pairs=(), alternative=0))


def _points_clicked(state: State, snap: Snap) -> State:
    """By turns a point of the aligned scans (or the model) and the same one on the new scan."""
    draft = draft_of(state)
    new = unaligned(draft) if draft is not None else None
    if draft is None or new is None:
        return state
    on_new = snap.owner >= 0 and draft.scans[snap.owner] is new
    if on_new != (len(state.model.clicks) % 2 == 1):
        raise BadInput("click by turns: first the point on the aligned scans, then the same point on the new one.")
    return _clicked(state, snap)


def _aligned_by_points(state: State) -> State:
    """The pairs are given to the alignment, which refines the pose that they tell."""
    draft, clicks = draft_of(state), state.model.clicks
    new = unaligned(draft) if draft is not None else None
    if draft is None or new is None:
        raise BadInput("every scan is aligned already; add a scan first.")
    if len(clicks) < 6:
        raise BadInput(f"there are {len(clicks) // 2} pairs of points; click at least 3.")
    to_new = inverse(scan_poses(state)[draft.scans.index(new)])
    points = [snap.point for snap in clicks]
    pairs = tuple((a, apply(to_new, b)) for a, b in zip(points[::2], points[1::2], strict=False))
    return ChooseTool(SELECT).apply(replace(state, model=replace(state.model, pairs=pairs, alternative=0)))


def _clicked(state: State, snap: Snap) -> State:
    return replace(state, model=replace(state.model, clicks=(*state.model.clicks, snap)))


def _box_clicked(state: State, snap: Snap) -> State:
    state = _clicked(state, snap)
    if len(state.model.clicks) < 3:
        _check_apart(state.model.clicks)
        return state
    settings = state.model.settings
    depth = settings.height if settings.far == BY_HEIGHT else None
    return operated(state, box_of(state.model.clicks, state.model.eye, depth, settings.combine))


def _sketch_clicked(state: State, snap: Snap) -> State:
    scene = scene_to_click(state)
    if scene is None:
        return state
    T = sketch_frame(snap, scene)
    on = on_model(snap)
    drawing = Drawing(T, on if isinstance(on, FaceAt) else None, guides_of(scene, T))
    return replace(state, model=replace(state.model, drawing=drawing))


def _drawn(state: State, ray: Ray) -> State:
    """One more corner of the sketch; a click on the first one closes it, and it is ready to be extruded."""
    drawing = state.model.drawing
    if drawing is None:
        return state
    xy = on_plane(ray.origin, ray.direction, drawing.T_model_plane)
    options = SketchOptions(infer=state.model.settings.infer)
    drawing = replace(drawing, stroke=clicked(drawing.stroke, xy, drawing.guides, options))
    state = replace(state, model=replace(state.model, drawing=drawing))
    return _sketched(state, drawing) if drawing.stroke.closed else state


def _close_sketch(state: State) -> State:
    drawing = state.model.drawing
    if drawing is None:
        raise BadInput("click a face or the support to draw on first.")
    drawing = replace(drawing, stroke=closed(drawing.stroke, drawing.guides, SketchOptions(infer=state.model.settings.infer)))
    return _sketched(state, drawing)


def _sketched(state: State, drawing: Drawing) -> State:
    shown = built(state)
    number = 1 + (len(shown.sketches) if shown is not None else 0)
    step = Sketch(f"sketch {number}", drawing.T_model_plane, drawing.stroke.outline, drawing.on)
    return ChooseTool(EXTRUDE).apply(operated(state, step))


def _extrude_clicked(state: State, snap: Snap) -> State:
    """A click on a face says how far, when that is what is asked for."""
    if state.model.settings.far != TO_FACE:
        return state
    point, normal = plane_of(snap)
    return _extruded(state, FaceAt(point, normal))


def _extrude(state: State) -> State:
    if state.model.settings.far == TO_FACE:
        raise BadInput("click the face or patch that the extrusion goes to.")
    return _extruded(state, None)


def _extruded(state: State, to: FaceAt | None) -> State:
    shown, settings = built(state), state.model.settings
    if shown is None or not shown.sketches:
        raise BadInput("there is no sketch to extrude; draw one first.")
    height = settings.height if settings.far == BY_HEIGHT else None
    return operated(state, Extrude(shown.sketches[-1].name, height, to, settings.combine))


def _plane_clicked(state: State, snap: Snap) -> State:
    """A face gives its plane with one click; corners, edges and readings with three."""
    before = state.model.clicks
    if snap.kind == "plane" and not before:
        return _clicked(state, snap)
    state = _clicked(replace(state, model=replace(state.model, clicks=before if 0 < len(before) < 3 else ())), snap)
    if len(state.model.clicks) < 3:
        _check_apart(state.model.clicks)
    else:
        plane_normal(np.array([click.point for click in state.model.clicks]), state.model.eye)
    return state


def tool_plane(state: State) -> tuple[NDArray, NDArray] | None:
    """Point (3,) [m] and normal (3,) of the plane that cuts or mirrors, with its offset; None while it is not clicked yet."""
    clicks, settings = state.model.clicks, state.model.settings
    if len(clicks) == 1 and clicks[0].kind == "plane":
        point, normal = plane_of(clicks[0])
    elif len(clicks) == 3:
        points = np.array([click.point for click in clicks])
        point, normal = points[0], plane_normal(points, state.model.eye)
    else:
        return None
    return point + settings.offset * normal, -normal if settings.flip else normal


def _cut(state: State) -> State:
    return operated(state, CutByPlane(*_plane_needed(state)))


def _mirrored(state: State) -> State:
    return operated(state, Mirror(*_plane_needed(state), state.model.settings.keep_original))


def _plane_needed(state: State) -> tuple[NDArray, NDArray]:
    plane = tool_plane(state)
    if plane is None:
        raise BadInput("click a face whose plane is meant, or three points of a plane, first.")
    return plane


def _measure_clicked(state: State, snap: Snap) -> State:
    clicks = state.model.clicks
    return replace(state, model=replace(state.model, clicks=(snap,) if len(clicks) != 1 else (*clicks, snap)))


def measurement(state: State) -> Measurement | None:
    """What the measuring tool tells of its two clicks."""
    if state.model.tool != MEASURE or len(state.model.clicks) != 2:
        return None
    return measure(*(reference_of(snap) for snap in state.model.clicks))


def _check_apart(clicks: tuple[Snap, ...]) -> None:
    """Raises BadInput when a click is on the one before it."""
    if len(clicks) > 1 and np.linalg.norm(clicks[-1].point - clicks[-2].point) < 5e-4:
        raise BadInput("this click is on the one before; click another place.")


CLICKED: dict[str, Callable[[State, Snap], State]] = {
    BOX: _box_clicked,
    SKETCH: _sketch_clicked,
    EXTRUDE: _extrude_clicked,
    CUT: _plane_clicked,
    MIRROR: _plane_clicked,
    MEASURE: _measure_clicked,
    POINTS: _points_clicked,
}
FINISHED: dict[str, Callable[[State], State]] = {
    SKETCH: _close_sketch,
    EXTRUDE: _extrude,
    CUT: _cut,
    MIRROR: _mirrored,
    POINTS: _aligned_by_points,
}
