"""What can be typed for what is selected: distances, lengths, angles and ways, each with its value as it is now."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from handey_studio.app.modelling.derived import built
from handey_studio.app.modelling.steps import MovePicked, MovePickedBy, SetPicked
from handey_studio.app.state import State
from handey_studio.geometry import Polyhedron
from handey_studio.modeling.lookup import edge_at, face_at
from handey_studio.modeling.references import EdgeAt, FaceAt
from handey_studio.session.strokes import PARALLEL, on_model, opposite_face

AXES = (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0)), ("z", (0.0, 0.0, 1.0)))


@dataclass(frozen=True)
class Typed:
    """One number that can be typed: what it means, its unit "m" or "rad", its value now, and the command that sets it."""

    words: str
    unit: str
    now: float
    command: Callable[[float], Any]


def typed_options(state: State) -> tuple[Typed, ...]:
    """What can be typed for what is selected, the likeliest first; nothing while nothing of the model is."""
    shown = built(state)
    references = [reference for snap in state.model.picked if (reference := on_model(snap)) is not None]
    if shown is None or shown.solid is None or not references:
        return ()
    faces = [reference for reference in references if isinstance(reference, FaceAt)]
    if len(faces) == 2:
        return _of_two_faces(shown.solid, *faces)
    if isinstance(references[-1], FaceAt):
        return _of_face(shown.solid, references[-1])
    moves = tuple(_move_along(name, axis) for name, axis in AXES)
    return (*_of_edge(shown.solid, references[-1]), *moves) if isinstance(references[-1], EdgeAt) else moves


def _of_face(solid: Polyhedron, face: FaceAt) -> tuple[Typed, ...]:
    moved = Typed("move outward by", "m", 0.0, MovePicked)
    other = opposite_face(solid, face)
    if other is None:
        return (moved,)
    return Typed("distance to the opposite face", "m", _apart(solid, face, other), lambda value: SetPicked(value, "distance")), moved


def _of_two_faces(solid: Polyhedron, one: FaceAt, other: FaceAt) -> tuple[Typed, ...]:
    cosine = float(one.normal @ other.normal)
    if abs(cosine) > PARALLEL:
        return (Typed("distance between the faces", "m", _apart(solid, one, other), lambda value: SetPicked(value, "distance")),)
    inner = float(np.pi - np.arccos(np.clip(cosine, -1.0, 1.0)))
    return (Typed("angle between the faces", "rad", inner, lambda value: SetPicked(value, "angle")),)


def _of_edge(solid: Polyhedron, at: EdgeAt) -> tuple[Typed, ...]:
    edge, _ = edge_at(solid, at)
    length = float(np.linalg.norm(solid.vertices[edge.end] - solid.vertices[edge.start]))
    return (Typed("length", "m", length, lambda value: SetPicked(value, "length")),)


def _move_along(name: str, axis: tuple[float, float, float]) -> Typed:
    return Typed(f"move along {name} by", "m", 0.0, lambda value: MovePickedBy(value * np.array(axis)))


def _apart(solid: Polyhedron, one: FaceAt, other: FaceAt) -> float:
    f, g = face_at(solid, one), face_at(solid, other)
    return abs(float(solid.offsets[f] - np.sign(solid.normals[f] @ solid.normals[g]) * solid.offsets[g]))
