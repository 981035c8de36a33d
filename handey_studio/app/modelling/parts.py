"""A model becomes a part: kept in the library, known to the session, found in the cell's pile; and parts of the library edited again."""

from dataclasses import dataclass, replace
from typing import Any

from handey_studio.app.modelling import derived
from handey_studio.app.modelling.look import Material
from handey_studio.app.modelling.scanning import Order, fresh
from handey_studio.app.setting_up import FREE_TABLE
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.base.errors import unknown_name
from handey_studio.modeling.draft import Draft
from handey_studio.modeling.draft_files import draft_to_bytes, read_draft
from handey_studio.modeling.operations import TakeSuggestion
from handey_studio.session import Session
from handey_studio.session.modelling import find_parts, part_of, provenance_of, with_part
from handey_studio.task.move import MoveOptions
from handey_studio.task.plan import MoveCommand
from handey_studio.world import Part
from handey_studio.world.library import bundled
from handey_studio.world.part_writing import write_part

TURN = "turn it over (Model, on the left) and find it again (Part, on the right)."
LIMITS = {"density": (1.0, 25_000.0, "kg/m³"), "friction": (0.01, 2.0, "")}


@dataclass(frozen=True)
class SetMaterial:
    """What the part is made of: `name` as in `Material`."""

    name: str
    value: float

    def apply(self, state: State) -> State:
        low, high, unit = LIMITS[self.name]
        if not low <= self.value <= high:
            raise BadInput(f"the {self.name} is {self.value:g}; it must be a number from {low:g} to {high:g} {unit}".rstrip() + ".")
        material = replace(state.model.material, **{self.name: self.value})
        return replace(state, model=replace(state.model, material=material))


@dataclass(frozen=True)
class NameModel:
    """The model, and the part that it becomes, get a name."""

    name: str

    def apply(self, state: State) -> State:
        draft = state.session.draft
        if draft is None:
            raise BadInput("there is no model to name.")
        named = replace(draft, name=self.name.strip() or draft.name)
        return state.changed(f"name it {named.name}", replace(state.session, draft=named))


@dataclass(frozen=True)
class SavePart:
    """The model joins the user's library as a part of that name, with its draft; with `overwrite` in place of an older one."""

    name: str
    overwrite: bool = False

    def run(self, bench: Any) -> State:
        state = NameModel(self.name).apply(bench.state)
        part = modelled_part(state)
        if (bundled() / "parts" / f"{part.name}.obj").is_file() and state.library.folder != bundled():
            raise BadInput(f'"{part.name}" is a part that comes with Handey Studio; give yours another name.')
        draft = None if state.session.draft is None else draft_to_bytes(state.session.draft)
        kept = write_part(state.library, part, draft, self.overwrite)
        words = f'Saved "{kept.name}" to {state.library.folder / "parts"}.'
        return replace(state, model=replace(state.model, saves=state.model.saves + 1)).told(words, "good")


@dataclass(frozen=True)
class FindIt:
    """The model joins the session as a part of that name, and the localizer looks for it in the cell."""

    name: str

    def run(self, bench: Any) -> State:
        state = NameModel(self.name).apply(bench.state)
        return _looking_for(bench, state, modelled_part(state))


@dataclass(frozen=True)
class FindAgain:
    """The localizer looks once more for the part that the model became, for instance after the object was turned over."""

    def run(self, bench: Any) -> State:
        part = known_part(bench.state)
        if part is None:
            raise BadInput("the model is no part of this session yet; press Find it first.")
        return _looking_for(bench, bench.state, part)


@dataclass(frozen=True)
class UsePart:
    """A part of the library joins the workcell, and the localizer looks for it."""

    name: str

    def run(self, bench: Any) -> State:
        return _looking_for(bench, bench.state, bench.state.library.part(self.name))


@dataclass(frozen=True)
class EditPart:
    """A part of the library is edited: by its own history, or, if it has none, from its shape. Undo goes back to the model before."""

    name: str

    def run(self, bench: Any) -> State:
        state = bench.state
        part, drafts = state.library.part(self.name), state.library.drafts()
        draft = read_draft(drafts[self.name]) if self.name in drafts else draft_of_shape(part)
        look = replace(fresh(state.model), open=True, material=Material(part.density, part.friction))
        return replace(state, model=look).changed(f"edit {self.name}", replace(state.session, draft=draft))


@dataclass(frozen=True)
class PickPart:
    """A part of the library is looked at in the list."""

    name: str

    def apply(self, state: State) -> State:
        if self.name and self.name not in state.library.part_files():
            raise unknown_name("part", self.name, state.library.part_files())
        return replace(state, model=replace(state.model, part="" if state.model.part == self.name else self.name))


def known_part(state: State) -> Part | None:
    """The part that the model became in this session, while the model is put aside."""
    draft = state.session.draft
    return None if draft is None or state.modelling else state.session.part(draft.name)


def modelled_part(state: State) -> Part:
    """The model as a part. Raises BadInput when there is no solid, or it is not one that can be."""
    draft, shown, judged = derived.draft_of(state), derived.built(state), derived.truth(state)
    if draft is None or shown is None or shown.solid is None:
        raise BadInput("there is no solid yet; take the model that is suggested, or draw one with the tools.")
    broken = next((check for check in judged.checks if not check.ok), None) if judged is not None else None
    if broken is not None:
        raise BadInput(f"this is not yet a part: {broken.sentence} {broken.fix}".strip())
    material = state.model.material
    return part_of(shown.solid, draft.name, material.density, material.friction, provenance_of(draft, shown, judged))


def draft_of_shape(part: Part) -> Draft:
    """A draft whose one step is a part's shape as it is."""
    faces = tuple(face.loops for face in part.solid.faces)
    return Draft(part.name, (), (TakeSuggestion(part.solid.vertices, faces, ("given",) * len(faces)),))


def found(state: State, session: Session) -> State:
    """The cell was scanned and searched: the MOVE is looked at, with the part that was looked for."""
    shown = replace(state.session, scene=session.scene, results=(), cell_now=session.cell_now)
    state = replace(state, session=shown, model=replace(state.model, open=False))
    name = state.command.part if state.command is not None else ""
    count = sum(placed.part.name == name for placed in shown.located)
    if not count:
        reason = shown.scene.located.reason if shown.scene is not None else ""
        return state.told(f'"{name}" was not found in the cell. {reason} Located, on the right, tells what was weighed.', "bad")
    many = f" {count} times" if count > 1 else ""
    doubts = shown.scene.doubts if shown.scene is not None else {}
    if all(doubts.get(placed.name, 0.0) > MoveOptions().most_doubt for placed in shown.located if placed.part.name == name):
        return state.told(f'"{name}" was found{many}, but this view does not tell how it stands: {TURN}', "bad")
    return state.told(f'"{name}" was found{many}. Press Plan or MOVE.', "good")


def _looking_for(bench: Any, state: State, part: Part) -> State:
    session = with_part(state.session, part)
    to = state.command.to if state.command is not None and not state.command.to.startswith("on:") else FREE_TABLE
    commands = (*session.commands[:-1], MoveCommand(part.name, to))
    known = state.changed(f"find {part.name}", replace(session, commands=commands))
    return Order(f"Looking for {part.name}", find_parts, found).given(bench, known)
