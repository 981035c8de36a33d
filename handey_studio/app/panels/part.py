"""The right panel's Part tab: the truth about the model, its history, saving it, finding it, and the library."""

import logging
from functools import lru_cache
from typing import Any

import numpy as np
import viser

from handey_studio.app import html, palette
from handey_studio.app.modelling import derived
from handey_studio.app.modelling.look import BY_DISTANCE, BY_SCAN
from handey_studio.app.modelling.parts import EditPart, FindAgain, FindIt, NameModel, PickPart, SavePart, SetMaterial, UsePart, known_part
from handey_studio.app.modelling.scanning import UploadScan
from handey_studio.app.modelling.showing import ColourBy, PointAtCheck
from handey_studio.app.modelling.steps import EditStep, LookAtStep, RemoveStep
from handey_studio.app.panels.part_html import about_html, findings_html, grasps_html, history_html, legend_html, library_html, numbers_html
from handey_studio.app.state import State
from handey_studio.app.wire import Send, element_id, on_click, on_submit, on_upload, on_user, set_to
from handey_studio.base import BadInput
from handey_studio.modeling.operations import Operation
from handey_studio.session.step_numbers import number_of
from handey_studio.world import Library, Part
from handey_studio.world.model_files import read_part

log = logging.getLogger(__name__)

NONE = -1


class PartPanel:
    """Top to bottom: whether it is a part, saving and finding it, numbers and grasps, its history, the library."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._parts: tuple[Part, ...] = ()
        self._step, self._factor, self._chosen = NONE, 1e-3, ""
        self._about = gui.add_html("")
        self._again = gui.add_button(
            "Find it again", icon=viser.Icon.SEARCH, color=palette.BLUE, visible=False, hint="In the cell as it is now"
        )
        self._check: Any = gui.add_number("Check picked", NONE, step=1)
        self._add_saving(gui)
        self._numbers = gui.add_html("")
        self._colours: Any = gui.add_dropdown("Colour readings by", (BY_SCAN, BY_DISTANCE), visible=False)
        self._legend = gui.add_html("")
        with gui.add_folder("History", expand_by_default=True) as self._past:
            self._history = gui.add_html("")
            self._row: Any = gui.add_number("Step picked", NONE, step=1)
            with gui.add_form(None, visible=False) as self._form:
                self._value: Any = gui.add_number("Its number (mm)", 0.0, step=0.1)
                self._change = gui.add_button("Change the step", icon=viser.Icon.PENCIL, color=palette.ARM_DARK)
            self._remove = gui.add_button("Remove the step", icon=viser.Icon.TRASH, color="gray", visible=False)
        self._add_library(gui)
        self._wire(send)

    def _add_saving(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("The part", expand_by_default=True, visible=False) as self._saving:
            with gui.add_form(None) as self._naming:
                self._name: Any = gui.add_text("Part name", "part", hint="Enter sets it")
            self._find = gui.add_button("Find it", icon=viser.Icon.SEARCH, color=palette.BLUE, hint="In the cell; then MOVE it")
            self._save = gui.add_button("Save the part", icon=viser.Icon.DEVICE_FLOPPY, color=palette.ARM_DARK)
            self._trial = gui.add_upload_button(
                "Find it in a scan", icon=viser.Icon.UPLOAD, color="gray", mime_type=".png,.json,.npy,.ply,.pcd"
            )
            with gui.add_folder("Density, friction, overwrite", expand_by_default=False):
                self._density: Any = gui.add_number("Density (kg/m³)", 700.0, min=1.0, max=25_000.0, step=10.0)
                self._friction: Any = gui.add_number("Friction", 0.5, min=0.01, max=2.0, step=0.05)
                self._replace = gui.add_checkbox("Overwrite one of that name", False)

    def _add_library(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("Library", expand_by_default=True):
            self._library = gui.add_html("")
            self._picked: Any = gui.add_number("Part picked", NONE, step=1)
            self._edit = gui.add_button("Edit this part", icon=viser.Icon.PENCIL, color=palette.ARM_DARK, visible=False)
            self._use = gui.add_button("Find it in the cell", icon=viser.Icon.SEARCH, color="gray", visible=False)

    def _wire(self, send: Send) -> None:
        on_user(self._colours, send, lambda event: ColourBy(event.target.value))
        on_user(self._check, send, lambda event: PointAtCheck(int(event.target.value), event.client_id))
        on_user(self._row, send, lambda event: LookAtStep(int(event.target.value)))
        on_submit(self._form, send, self._changed)
        on_click(self._change, send, lambda _: self._changed())
        on_click(self._remove, send, lambda _: RemoveStep(self._step))
        on_submit(self._naming, send, lambda: NameModel(self._name.value))
        on_user(self._density, send, lambda event: SetMaterial("density", float(event.target.value)))
        on_user(self._friction, send, lambda event: SetMaterial("friction", float(event.target.value)))
        on_click(self._save, send, lambda _: SavePart(self._name.value, bool(self._replace.value)))
        on_click(self._find, send, lambda _: FindIt(self._name.value))
        on_click(self._again, send, lambda _: FindAgain())
        on_upload(self._trial, send, lambda event: UploadScan(event.target.value.name, event.target.value.content, trial=True))
        on_user(self._picked, send, lambda event: PickPart(self._parts[int(event.target.value) % len(self._parts)].name))
        on_click(self._edit, send, lambda _: EditPart(self._chosen))
        on_click(self._use, send, lambda _: UsePart(self._chosen))

    def _changed(self) -> EditStep:
        return EditStep(self._step, float(self._value.value) * self._factor)

    def render(self, old: State | None, new: State) -> None:
        for picked in (self._check, self._row, self._picked):
            set_to(picked, value=NONE)
        if old is None or _part_looks(old) != _part_looks(new):
            self._show_part(new)
        if old is None or _library_looks(old) != _library_looks(new):
            self._show_library(new)

    def _show_part(self, state: State) -> None:
        shown, judged, draft = derived.built(state), derived.truth(state), derived.draft_of(state)
        solid = shown is not None and shown.solid is not None
        hidden = html.unseen([element_id(self._check)])
        about = findings_html(judged, state.model.check, element_id(self._check)) if solid else about_html(state)
        set_to(self._about, content=hidden + about)
        set_to(self._again, visible=known_part(state) is not None, disabled=state.job is not None)
        set_to(self._numbers, content=numbers_html(state) + grasps_html(derived.grasps(state)) if solid else "")
        set_to(self._colours, visible=judged is not None and bool(judged.scans), value=state.model.colours)
        set_to(self._legend, content=legend_html(judged) if state.model.colours == BY_DISTANCE else "")
        steps = derived.steps(state)
        row = html.unseen([element_id(self._row)])
        set_to(self._history, content=row + history_html(steps, state.model.step, element_id(self._row)))
        self._show_step(draft.operations if draft is not None else (), state.model.step)
        set_to(self._saving, visible=solid)
        set_to(self._past, visible=state.modelling)
        if draft is not None:
            set_to(self._name, value=draft.name)
        set_to(self._density, value=state.model.material.density)
        set_to(self._friction, value=state.model.material.friction)
        for button in (self._find, self._use):
            set_to(button, disabled=state.job is not None)

    def _show_step(self, operations: tuple[Operation, ...], step: int | None) -> None:
        """The number of the step that is looked at."""
        self._step = NONE if step is None else step - 1
        operation = operations[self._step] if 0 <= self._step < len(operations) else None
        number = number_of(operation) if operation is not None else None
        set_to(self._remove, visible=operation is not None)
        set_to(self._form, visible=number is not None)
        if number is not None:
            value, unit = number
            self._factor = 1e-3 if unit == "m" else float(np.deg2rad(1.0))
            label = "Its number (mm)" if unit == "m" else "Its number (deg)"
            set_to(self._value, label=label, value=round(value / self._factor, 3) + 0.0)

    def _show_library(self, state: State) -> None:
        self._parts = library_parts(state.library, state.model.saves)
        self._chosen = state.model.part
        cards = library_html(self._parts, self._chosen, tuple(state.library.drafts()), element_id(self._picked))
        set_to(self._library, content=html.unseen([element_id(self._picked)]) + cards)
        for button in (self._edit, self._use):
            set_to(button, visible=bool(self._chosen))


@lru_cache(maxsize=2)
def library_parts(library: Library, saves: int) -> tuple[Part, ...]:
    """The library's parts by name; `saves` says how often one was kept, so that a new one is read. Files that are no part are left out."""
    found = []
    for path in (path for _, path in sorted(library.part_files().items())):
        try:
            found.append(read_part(path))
        except BadInput as error:
            log.warning("%s is left out of the library: %s", path, error)
    return tuple(found)


def _part_looks(state: State) -> tuple:
    look = state.model
    known = id(look.worked), look.colours, look.check, look.step, look.material, id(state.session.parts)
    return (state.loads, look.open, id(state.session.draft), *known, state.job is None, id(state.robot))


def _library_looks(state: State) -> tuple:
    return state.library, state.model.saves, state.model.part, state.loads
