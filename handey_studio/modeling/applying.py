"""What each kind of step does to the state: one function a kind."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from handey_studio.base import BadInput
from handey_studio.base.errors import unknown_name
from handey_studio.geometry import Face, Polyhedron
from handey_studio.modeling import editing
from handey_studio.modeling.drawing import box_body, extruded_body, placed
from handey_studio.modeling.lookup import corner_at, edge_at, face_at
from handey_studio.modeling.operations import (
    AlignScan,
    Box,
    Combine,
    ConfirmFace,
    CutByPlane,
    Delete,
    Extrude,
    Mirror,
    MoveCorner,
    MoveEdge,
    MoveFace,
    Operation,
    SetAngle,
    SetDistance,
    SetLength,
    Sketch,
    TakeSuggestion,
)
from handey_studio.modeling.planes import Change, inherited
from handey_studio.modeling.solids import combined, cut_by_plane, mirrored
from handey_studio.modeling.soundness import sound
from handey_studio.modeling.state import Maker, State

SET_BY_HAND = "set by hand"
ASSUMED = "assumed"
SAME_PLANE = 1e-9
NOBODY: tuple[str, Maker] = ("drawn", (-1, -1))


def applied(operation: Operation, state: State) -> State:
    """The state after an operation. Raises BadInput with one sentence when it cannot be done."""
    return STEPS[type(operation)](operation, state)


def _take_suggestion(operation: TakeSuggestion, state: State) -> State:
    for loops in operation.faces:
        if not loops or any(len(set(loop)) < 3 or not all(0 <= c < len(operation.vertices) for c in loop) for loop in loops):
            raise BadInput(f"a face of the suggestion lists corners {loops}; it needs 3 or more of {len(operation.vertices)} corners.")
    drawn = Polyhedron(operation.vertices, tuple(Face(loops[0], loops[1:]) for loops in operation.faces))
    solid = sound(drawn.vertices, drawn.faces)
    return _with_solid(state, solid, [(drawn, _labels(operation.sources, state.count))])


def _align_scan(operation: AlignScan, state: State) -> State:
    if operation.scan not in state.scans:
        raise unknown_name("scan", operation.scan, state.scans)
    if operation.scan == state.scans[0]:
        raise BadInput(f'scan "{operation.scan}" is the first one, whose world is the frame of the model; align the others to it.')
    others = tuple(pose for pose in state.poses if pose[0] != operation.scan)
    return replace(state, poses=(*others, (operation.scan, operation.T_model_scan)))


def _box(operation: Box, state: State) -> State:
    return _with_body(state, box_body(operation), operation.combine, "drawn: box")


def _sketch(operation: Sketch, state: State) -> State:
    others = tuple(sketch for sketch in state.sketches if sketch.name != operation.name)
    return replace(state, sketches=(*others, placed(operation, state.solid)))


def _extrude(operation: Extrude, state: State) -> State:
    return _with_body(state, extruded_body(operation, state), operation.combine, f"drawn: {operation.sketch}")


def _cut_by_plane(operation: CutByPlane, state: State) -> State:
    solid = _solid(state)
    cut = cut_by_plane(solid, operation.point, operation.normal)
    return _with_solid(state, cut, [(solid, _own_labels(state))], ("drawn: cut", (state.count, 0)))


def _move_face(operation: MoveFace, state: State) -> State:
    solid = _solid(state)
    return _with_change(state, editing.moved_face(solid, face_at(solid, operation.face), operation.distance))


def _move_edge(operation: MoveEdge, state: State) -> State:
    solid = _solid(state)
    return _with_change(state, editing.moved_edge(solid, edge_at(solid, operation.edge)[0], operation.way))


def _move_corner(operation: MoveCorner, state: State) -> State:
    solid = _solid(state)
    return _with_change(state, editing.moved_corner(solid, corner_at(solid, operation.corner), operation.way))


def _set_distance(operation: SetDistance, state: State) -> State:
    solid = _solid(state)
    f, other = face_at(solid, operation.face), face_at(solid, operation.other)
    return _with_change(state, editing.with_distance(solid, f, other, operation.distance))


def _set_length(operation: SetLength, state: State) -> State:
    solid = _solid(state)
    return _with_change(state, editing.with_length(solid, *edge_at(solid, operation.edge), operation.length))


def _set_angle(operation: SetAngle, state: State) -> State:
    solid = _solid(state)
    f, other = face_at(solid, operation.face), face_at(solid, operation.other)
    return _with_change(state, editing.with_angle(solid, f, other, operation.angle))


def _mirror(operation: Mirror, state: State) -> State:
    solid = _solid(state)
    image = mirrored(solid, operation.point, operation.normal)
    labels = _labels(("assumed: symmetric",) * len(image.faces), state.count)
    if not operation.keep_original:
        return _with_solid(state, image, [(image, _own_labels(state))])
    return _with_solid(state, combined(solid, image, "join"), [(solid, _own_labels(state)), (image, labels)])


def _delete(operation: Delete, state: State) -> State:
    if operation.what == "solid":
        _solid(state)
        return replace(state, solid=None, sources=(), makers=())
    names = [sketch.name for sketch in state.sketches]
    if operation.what not in names:
        raise unknown_name("sketch", operation.what, names)
    return replace(state, sketches=tuple(sketch for sketch in state.sketches if sketch.name != operation.what))


def _confirm_face(operation: ConfirmFace, state: State) -> State:
    f = face_at(_solid(state), operation.face)
    if not state.sources[f].startswith(ASSUMED):
        raise BadInput(f'the face is "{state.sources[f]}", not assumed; only assumed faces are confirmed.')
    return replace(state, sources=(*state.sources[:f], operation.source, *state.sources[f + 1 :]))


def _solid(state: State) -> Polyhedron:
    if state.solid is None:
        raise BadInput("there is no solid yet; draw a box, extrude a sketch or take a suggestion first.")
    return state.solid


def _labels(sources: tuple[str, ...], step: int) -> list[tuple[str, Maker]]:
    """What a step's own faces carry through later steps: where they come from, and their maker."""
    return [(source, (step, f)) for f, source in enumerate(sources)]


def _own_labels(state: State) -> list[tuple[str, Maker]]:
    return list(zip(state.sources, state.makers, strict=True))


def _with_body(state: State, body: Polyhedron, combine: Combine, source: str) -> State:
    """The state with a new body joined to its solid, or cut from it; without a solid the body becomes it."""
    labels = _labels((source,) * len(body.faces), state.count)
    if state.solid is None:
        if combine != "join":
            raise BadInput("there is no solid yet to cut from; join the first body.")
        return _with_solid(state, body, [(body, labels)])
    return _with_solid(state, combined(state.solid, body, combine), [(state.solid, _own_labels(state)), (body, labels)])


def _with_solid(
    state: State, solid: Polyhedron, parents: list[tuple[Polyhedron, list[tuple[str, Maker]]]], otherwise: tuple[str, Maker] = NOBODY
) -> State:
    """The state with another solid, whose faces carry on what is known of the parents' faces that they are pieces of."""
    labels = inherited(solid, parents, otherwise)
    return replace(state, solid=solid, sources=tuple(s for s, _ in labels), makers=tuple(m for _, m in labels))


def _with_change(state: State, change: Change) -> State:
    """The state with its solid edited; faces that have moved are no longer what was seen or assumed."""
    before, after = _solid(state), change.solid
    sources = []
    for g, f in enumerate(change.came_from):
        moved = np.abs(after.normals[g] - before.normals[f]).max() > SAME_PLANE or abs(after.offsets[g] - before.offsets[f]) > SAME_PLANE
        sources.append(SET_BY_HAND if moved else state.sources[f])
    return replace(state, solid=after, sources=tuple(sources), makers=tuple(state.makers[f] for f in change.came_from))


STEPS: dict[type[Operation], Callable[..., State]] = {
    TakeSuggestion: _take_suggestion,
    AlignScan: _align_scan,
    Box: _box,
    Sketch: _sketch,
    Extrude: _extrude,
    CutByPlane: _cut_by_plane,
    MoveFace: _move_face,
    MoveEdge: _move_edge,
    MoveCorner: _move_corner,
    SetDistance: _set_distance,
    SetLength: _set_length,
    SetAngle: _set_angle,
    Mirror: _mirror,
    Delete: _delete,
    ConfirmFace: _confirm_face,
}
