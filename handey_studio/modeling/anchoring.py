"""References carried along when an earlier step is edited: the same face, followed by who made it, wherever it now is.

A reference is geometry, so a small change needs nothing: what was meant is still the nearest. After a large one another face may be
nearer; then the face is known by its maker (`State.makers`), and the later step gets a reference to where that face now is.
"""

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import shapely

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron
from handey_studio.modeling.lookup import corner_at, edge_at, face_at, reference_to_face
from handey_studio.modeling.operations import Operation
from handey_studio.modeling.planes import faces_at_corners
from handey_studio.modeling.references import CornerAt, EdgeAt, FaceAt
from handey_studio.modeling.state import Maker, State

Renumber = Callable[[Maker], Maker]


def carried(operation: Operation, before: State, after: State, renumber: Renumber = lambda maker: maker) -> Operation:
    """An operation that was replayed on `before`, for replaying on `after`: what it refers to is the same face, edge or corner.

    `renumber` maps makers of `before` to those of `after`. What is not there any more, or there twice, is left as it was.
    """
    if before.solid is None or after.solid is None:
        return operation
    changes: dict[str, Any] = {}
    for field in fields(operation):
        reference = getattr(operation, field.name)
        if isinstance(reference, FaceAt | EdgeAt | CornerAt):
            try:
                changes[field.name] = _followed(reference, before, before.solid, after, after.solid, renumber)
            except BadInput:  # it named nothing before either
                continue
    return replace(operation, **changes) if changes else operation


def _followed(reference: Any, before: State, old: Polyhedron, after: State, new: Polyhedron, renumber: Renumber) -> Any:
    wanted = [renumber(maker) for maker in before.makers]
    if isinstance(reference, FaceAt):
        return _face(reference, wanted[face_at(old, reference)], after, new)
    if isinstance(reference, EdgeAt):
        edge, _ = edge_at(old, reference)
        return _edge(reference, {wanted[edge.left], wanted[edge.right]}, after, new)
    meeting = faces_at_corners(old)[corner_at(old, reference)]
    return _corner(reference, {wanted[f] for f in meeting}, after, new)


def _face(reference: FaceAt, maker: Maker, after: State, new: Polyhedron) -> FaceAt:
    """The reference as it is if it still finds its face, else shifted onto that face."""
    same = [f for f, made in enumerate(after.makers) if made == maker]
    if not same or _finds(face_at, new, reference) in same:
        return reference
    references = [_on_face(new, f, reference) for f in same]
    return min(references, key=lambda moved: float(np.linalg.norm(moved.point - reference.point)))


def _on_face(new: Polyhedron, f: int, reference: FaceAt) -> FaceAt:
    """The point straight above or below on the face, if that is inside it, else one well inside."""
    T = new.face_frame(f)
    x, y = T[:3, :2].T @ (reference.point - T[:3, 3])
    if new.face_polygon(f, T).contains(shapely.Point(x, y)):
        return FaceAt(T[:3, 3] + T[:3, :2] @ (x, y), new.normals[f])
    return reference_to_face(new, f)


def _edge(reference: EdgeAt, makers: set[Maker], after: State, new: Polyhedron) -> EdgeAt:
    same = [e for e in new.edges if {after.makers[e.left], after.makers[e.right]} == makers]
    found = _finds(edge_at, new, reference)
    if len(same) != 1 or (found is not None and found[0] in same):
        return reference
    start, stop = new.vertices[same[0].start], new.vertices[same[0].end]
    sense = 1.0 if (stop - start) @ reference.direction > 0 else -1.0
    return EdgeAt(0.5 * (start + stop), sense * (stop - start))


def _corner(reference: CornerAt, makers: set[Maker], after: State, new: Polyhedron) -> CornerAt:
    meeting = faces_at_corners(new)
    same = [v for v, faces in enumerate(meeting) if {after.makers[f] for f in faces} == makers]
    return CornerAt(new.vertices[same[0]]) if len(same) == 1 and _finds(corner_at, new, reference) not in same else reference


def _finds(look_up: Callable[[Polyhedron, Any], Any], solid: Polyhedron, reference: Any) -> Any:
    """What a reference finds; None when nothing."""
    try:
        return look_up(solid, reference)
    except BadInput:
        return None
