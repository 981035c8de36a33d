"""Steps of the model's history, added, changed, taken out and looked at; and what is done to what is selected."""

from dataclasses import dataclass, replace
from typing import TypeVar

from numpy.typing import NDArray

from handey_studio.app.modelling import derived
from handey_studio.app.modelling.look import SELECT
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.modeling.draft import Draft
from handey_studio.modeling.history import edited, removed, with_operation
from handey_studio.modeling.operations import (
    ConfirmFace,
    Delete,
    MoveCorner,
    MoveEdge,
    MoveFace,
    Operation,
    SetAngle,
    SetDistance,
    SetLength,
)
from handey_studio.modeling.references import CornerAt, EdgeAt, FaceAt
from handey_studio.modeling.replay import replay
from handey_studio.modeling.taking import take, take_alignment
from handey_studio.session.model_look import proposals, unaligned
from handey_studio.session.step_numbers import with_number
from handey_studio.session.strokes import on_model, opposite_face

R = TypeVar("R", FaceAt, EdgeAt, CornerAt)
NO_MODEL = "there is no model yet; scan an object or upload a scan first."


def operated(state: State, operation: Operation) -> State:
    """The model with one more step. Raises BadInput with one sentence when it cannot be done, and nothing changes."""
    draft = _needed(state)
    if state.model.step is not None and state.model.step < len(draft.operations):
        raise BadInput("an earlier step is looked at; show the whole model before you go on.")
    longer = with_operation(draft, operation)
    look = replace(state.model, clicks=(), drawing=None, picked=(), tool=SELECT, step=None, check=-1)
    return replace(state, model=look).changed(operation.told, replace(state.session, draft=longer))


@dataclass(frozen=True)
class TakeModel:
    """The suggested model is taken."""

    def apply(self, state: State) -> State:
        suggestion = derived.suggestion(state)
        if suggestion is None or suggestion.solid is None:
            raise BadInput("no model is suggested; click an object in the scan, or draw one with the tools.")
        return operated(state, take(suggestion))


@dataclass(frozen=True)
class AcceptAlignment:
    """The pose that is proposed for the new scan is taken."""

    def apply(self, state: State) -> State:
        draft, found = _needed(state), derived.alignment(state)
        scan, offered = unaligned(draft), proposals(found)
        if scan is None or found is None or not offered:
            raise BadInput("no pose is proposed for a scan; pick pairs of points on both scans.")
        return operated(state, take_alignment(scan.name, found, state.model.alternative % len(offered)))


@dataclass(frozen=True)
class OtherAlignment:
    """The next of the poses that fit the new scan nearly as well is shown."""

    def apply(self, state: State) -> State:
        return replace(state, model=replace(state.model, alternative=state.model.alternative + 1))


@dataclass(frozen=True)
class MovePicked:
    """The face that is selected moves along its normal [m], outward when positive."""

    distance: float

    def apply(self, state: State) -> State:
        return operated(state, MoveFace(_picked(state, FaceAt, "a face"), self.distance))


@dataclass(frozen=True, eq=False)
class MovePickedBy:
    """The face, edge or corner that is selected moves by a way (3,) [m]."""

    way: NDArray

    def apply(self, state: State) -> State:
        state = replace(state, model=replace(state.model, preview=None, drags=state.model.drags + 1))
        step = _moving(state, self.way)
        try:
            return operated(state, step)
        except BadInput as error:  # the arrow goes back to where it was
            return state.told(str(error), "bad")


@dataclass(frozen=True, eq=False)
class PreviewMove:
    """What is selected is being dragged by a way (3,) [m]: the model is shown as it would be, if it can be."""

    way: NDArray

    def apply(self, state: State) -> State:
        draft = derived.draft_of(state)
        if draft is None or not state.model.picked:
            return state
        longer = replace(draft, operations=(*draft.operations, _moving(state, self.way)))
        return replace(state, model=replace(state.model, preview=replay(longer).solid))


@dataclass(frozen=True)
class SetPicked:
    """A number is typed for what is selected [m or rad]: an edge's length; a face's distance from the one opposite, or from the second
    face that is selected; the angle between two faces that meet."""

    value: float
    kind: str

    def apply(self, state: State) -> State:
        if self.kind == "length":
            return operated(state, SetLength(_picked(state, EdgeAt, "an edge"), self.value))
        face, other = two_faces(state)
        step = SetAngle(face, other, self.value) if self.kind == "angle" else SetDistance(face, other, self.value)
        return operated(state, step)


@dataclass(frozen=True)
class ConfirmPicked:
    """The assumed face that is selected is right."""

    def apply(self, state: State) -> State:
        return operated(state, ConfirmFace(_picked(state, FaceAt, "a face")))


@dataclass(frozen=True)
class RemovePicked:
    """The step that is looked at goes, else the solid."""

    def apply(self, state: State) -> State:
        if derived.draft_of(state) is None:
            return state
        if state.model.step is not None:
            return RemoveStep(state.model.step - 1).apply(state)
        return operated(state, Delete())


@dataclass(frozen=True)
class LookAtStep:
    """The model as it was after a step (from 0); the last, or the one that is looked at, shows it whole."""

    index: int

    def apply(self, state: State) -> State:
        step = None if state.model.step == self.index + 1 else self.index + 1
        return replace(state, model=replace(state.model, step=step, picked=(), clicks=(), drawing=None, tool=SELECT))


@dataclass(frozen=True)
class RemoveStep:
    """A step is taken out; the others are replayed."""

    index: int

    def apply(self, state: State) -> State:
        draft = _needed(state)
        shorter = removed(draft, self.index)
        state = replace(state, model=replace(state.model, step=None, picked=()))
        return state.changed(f"remove {draft.operations[self.index].told}", replace(state.session, draft=shorter))


@dataclass(frozen=True)
class EditStep:
    """A step gets another number [m or rad]; the others are replayed."""

    index: int
    value: float

    def apply(self, state: State) -> State:
        draft = _needed(state)
        if not 0 <= self.index < len(draft.operations):
            raise BadInput(f"step {self.index + 1} is not there; the model has {len(draft.operations)} steps.")
        changed = edited(draft, self.index, with_number(draft.operations[self.index], self.value))
        state = replace(state, model=replace(state.model, step=None, picked=()))
        return state.changed(f"edit step {self.index + 1}", replace(state.session, draft=changed))


def two_faces(state: State) -> tuple[FaceAt, FaceAt]:
    """The two faces that are selected, or the one and the face opposite to it. Raises BadInput when there are none."""
    references = [on_model(snap) for snap in state.model.picked]
    faces = [reference for reference in references if isinstance(reference, FaceAt)]
    shown = derived.built(state)
    if len(faces) == 2:
        return faces[1], faces[0]
    other = opposite_face(shown.solid, faces[0]) if faces and shown is not None and shown.solid is not None else None
    if not faces or other is None:
        raise BadInput("select a face that has one parallel to it, or two faces (Shift and click), first.")
    return faces[0], other


def _moving(state: State, way: NDArray) -> Operation:
    """The step that moves what is selected."""
    reference = _reference(state)
    if isinstance(reference, FaceAt):
        return MoveFace(reference, float(reference.normal @ way))
    if isinstance(reference, EdgeAt):
        return MoveEdge(reference, way)
    return MoveCorner(_picked(state, CornerAt, "a corner"), way)


def _picked(state: State, kind: type[R], words: str) -> R:
    reference = _reference(state)
    if not isinstance(reference, kind):
        raise BadInput(f"select {words} of the model first.")
    return reference


def _reference(state: State) -> FaceAt | EdgeAt | CornerAt | None:
    return on_model(state.model.picked[-1]) if state.model.picked else None


def _needed(state: State) -> Draft:
    draft = derived.draft_of(state)
    if draft is None:
        raise BadInput(NO_MODEL)
    return draft
