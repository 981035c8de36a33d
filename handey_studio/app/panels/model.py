"""The left panel's first tab: a part is modelled here, from its scans to the solid."""

from typing import Any

import numpy as np
import viser

from handey_studio.app import html, palette
from handey_studio.app.actions import CancelMove
from handey_studio.app.commands import Redo, Undo
from handey_studio.app.modelling import derived
from handey_studio.app.modelling.accepting import Accept, accept_label
from handey_studio.app.modelling.guidance import model_step
from handey_studio.app.modelling.importing import UploadMesh
from handey_studio.app.modelling.look import BY_HEIGHT, POINTS, SELECT, TO_FACE, TO_TABLE
from handey_studio.app.modelling.scanning import SCAN_CELL, TURN_OVER, CloseModel, NewModel, OpenModel, SetUnit, StartExample, UploadScan
from handey_studio.app.modelling.steps import ConfirmPicked, OtherAlignment
from handey_studio.app.modelling.tool_clicks import BOX, CUT, EXTRUDE, MIRROR, SKETCH
from handey_studio.app.modelling.tools import ChooseTool, SetTool
from handey_studio.app.modelling.typed import Typed, typed_options
from handey_studio.app.panels.mesh import MeshPanel
from handey_studio.app.panels.move import choose
from handey_studio.app.panels.tools import TOOLS, toolbar
from handey_studio.app.state import State
from handey_studio.app.wire import Send, element_id, on_click, on_submit, on_upload, on_user, set_to
from handey_studio.modeling.picking.snap import MODEL
from handey_studio.session.mesh_files import SUFFIXES
from handey_studio.session.model_look import assumed_faces, proposals, unaligned

NONE = -1
NOTHING = "–"


class ModelPanel:
    """What to do next, the tools with what can be typed, and where scans come from."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._send = send
        self._typed: tuple[Typed, ...] = ()
        self._next = gui.add_html("")
        self._accept = gui.add_button("Accept", icon=viser.Icon.CHECK, color=palette.BLUE, visible=False, hint="Enter")
        self._other = gui.add_button("Another pose", icon=viser.Icon.REFRESH, color="gray", visible=False)
        self._cancel = gui.add_button("Stop", icon=viser.Icon.PLAYER_STOP, color=palette.VERMILLION, visible=False)
        self._mesh = MeshPanel(gui, send)
        self._tools = gui.add_html("")
        self._tool: Any = gui.add_number("Tool picked", NONE, step=1)
        self._add_parameters(gui)
        self._picked = gui.add_html("")
        self._add_typed(gui)
        self._undo = gui.add_button("Undo", icon=viser.Icon.ARROW_BACK_UP, color="gray", disabled=True)
        self._redo = gui.add_button("Redo", icon=viser.Icon.ARROW_FORWARD_UP, color="gray", disabled=True)
        self._add_sources(gui)
        self._wire(send)

    def _add_parameters(self, gui: viser.GuiApi) -> None:
        self._far: Any = gui.add_dropdown("How far", (TO_TABLE, BY_HEIGHT, TO_FACE))
        self._height: Any = gui.add_number("Height (mm)", 50.0, step=1.0)
        self._combine: Any = gui.add_dropdown("Then", ("join", "cut", "common"), hint="Join it, cut it away, or keep what is common")
        self._offset: Any = gui.add_number("Offset (mm)", 0.0, step=1.0, hint="Of the plane along its normal, outward when positive")
        self._flip = gui.add_checkbox("Other side", False)
        self._keep = gui.add_checkbox("Keep the original", True)
        self._infer = gui.add_checkbox("Infer ∥ ⟂ = ― |", True)

    def _add_typed(self, gui: viser.GuiApi) -> None:
        with gui.add_form(None, visible=False) as self._form:
            self._what: Any = gui.add_dropdown("Set", (NOTHING,))
            self._value: Any = gui.add_number("Exactly (mm)", 0.0, step=0.1)
            self._apply = gui.add_button("Apply", icon=viser.Icon.RULER_MEASURE, color=palette.ARM_DARK)
        self._confirm = gui.add_button("Confirm this face", icon=viser.Icon.CIRCLE_CHECK, color=palette.TEAL, visible=False)

    def _add_sources(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("Scans", expand_by_default=True):
            self._scan = gui.add_button("Scan the cell", icon=viser.Icon.SCAN, color=palette.ARM_DARK)
            self._turn = gui.add_button(
                "Turn the object over", icon=viser.Icon.ROTATE_CLOCKWISE, color="gray", hint="By hand, in the simulated cell"
            )
            self._upload = gui.add_upload_button(
                "Upload a scan",
                color=palette.ARM_DARK,
                icon=viser.Icon.UPLOAD,
                mime_type=".png,.json,.npy,.ply,.pcd",
                hint="PNG with its camera (JSON), NPY, PLY, PCD",
            )
            self._unit: Any = gui.add_dropdown("Unit of clouds", ("m", "cm", "mm"), hint="In what unit an uploaded PLY, PCD or NPY is")
        self._import = gui.add_upload_button(
            "Import a mesh",
            icon=viser.Icon.FILE_IMPORT,
            color="gray",
            mime_type=",".join(SUFFIXES),
            hint="OBJ, STL, PLY, OFF, STEP: it becomes the model",
        )
        self._example = gui.add_button("Start from an example", icon=viser.Icon.SCHOOL, color="gray", hint="An object to model")
        self._open = gui.add_button("Continue the model", icon=viser.Icon.CUBE, color=palette.ARM_DARK, visible=False)
        self._close = gui.add_button("Back to MOVE", icon=viser.Icon.ROBOT, color="gray", visible=False)
        self._new = gui.add_button("New model", icon=viser.Icon.FILE_PLUS, color="gray", visible=False)

    def _wire(self, send: Send) -> None:
        pressed = (
            (self._accept, Accept()),
            (self._other, OtherAlignment()),
            (self._cancel, CancelMove()),
            (self._confirm, ConfirmPicked()),
            (self._scan, SCAN_CELL),
            (self._turn, TURN_OVER),
            (self._example, StartExample()),
            (self._open, OpenModel()),
            (self._close, CloseModel()),
            (self._new, NewModel()),
            (self._undo, Undo()),
            (self._redo, Redo()),
        )
        for button, command in pressed:
            on_click(button, send, lambda _, command=command: command)
        on_user(self._tool, send, lambda event: ChooseTool(TOOLS[int(event.target.value) % len(TOOLS)]))
        set_by = {"far": self._far, "combine": self._combine, "flip": self._flip, "keep_original": self._keep, "infer": self._infer}
        for name, widget in set_by.items():
            on_user(widget, send, lambda event, name=name: SetTool(name, event.target.value))
        for name, widget in (("height", self._height), ("offset", self._offset)):
            on_user(widget, send, lambda event, name=name: SetTool(name, 1e-3 * float(event.target.value)))
        on_user(self._what, send, self._what_chosen)
        on_submit(self._form, send, self._submitted)
        on_click(self._apply, send, lambda _: self._submitted())
        on_upload(self._upload, send, lambda event: UploadScan(event.target.value.name, event.target.value.content))
        on_upload(self._import, send, lambda event: UploadMesh(event.target.value.name, event.target.value.content))
        on_user(self._unit, send, lambda event: SetUnit(event.target.value))

    def _what_chosen(self, event: Any) -> None:
        self._show_value(next((typed for typed in self._typed if typed.words == event.target.value), None))

    def _submitted(self) -> Any:
        chosen = next((typed for typed in self._typed if typed.words == self._what.value), None)
        if chosen is None:
            return None
        return chosen.command(float(self._value.value) * 1e-3 if chosen.unit == "m" else float(np.deg2rad(self._value.value)))

    def render(self, old: State | None, new: State) -> None:
        set_to(self._tool, value=NONE)
        self._mesh.render(old, new)
        if old is not None and _looks(old) == _looks(new):
            return
        look, draft = new.model, derived.draft_of(new)
        set_to(self._next, content=html.card(*model_step(new), testid="model-next"))
        label = accept_label(new)
        set_to(self._accept, visible=bool(label), label=label or "Accept")
        set_to(self._other, visible=look.tool != POINTS and len(proposals(derived.alignment(new))) > 1)
        set_to(self._cancel, visible=new.job is not None)
        bar = toolbar(look.tool, _usable(new), element_id(self._tool)) if draft is not None else ""
        set_to(self._tools, content=html.unseen([element_id(self._tool)]) + bar)
        self._show_parameters(new)
        self._show_picked(new)
        undo, redo = new.undo[-1:], new.redo[-1:]
        shown = new.session.draft is not None or bool(undo or redo)
        set_to(self._undo, label=f"Undo: {undo[0].label}" if undo else "Undo", disabled=not undo or new.job is not None, visible=shown)
        set_to(self._redo, label=f"Redo: {redo[0].label}" if redo else "Redo", disabled=not redo or new.job is not None, visible=shown)
        self._show_sources(new)

    def _show_parameters(self, state: State) -> None:
        tool, settings = state.model.tool, state.model.settings
        draws = tool in (BOX, EXTRUDE)
        far = (TO_TABLE, BY_HEIGHT, TO_FACE) if tool == EXTRUDE else (TO_TABLE, BY_HEIGHT)
        choose(self._far, far, settings.far if settings.far in far else TO_TABLE, False)
        set_to(self._far, visible=draws)
        set_to(self._height, visible=draws and settings.far == BY_HEIGHT, value=round(1e3 * settings.height, 3))
        set_to(self._combine, visible=draws, value=settings.combine)
        set_to(self._offset, visible=tool in (CUT, MIRROR), value=round(1e3 * settings.offset, 3))
        set_to(self._flip, visible=tool == CUT, value=settings.flip)
        set_to(self._keep, visible=tool == MIRROR, value=settings.keep_original)
        set_to(self._infer, visible=tool == SKETCH, value=settings.infer)

    def _show_picked(self, state: State) -> None:
        self._typed = typed_options(state) if state.model.tool == SELECT else ()
        shown = derived.built(state)
        picked_now = state.model.picked if state.modelling else ()
        rows = [
            (f"Selected {number + 1}" if len(state.model.picked) > 1 else "Selected", snap.of) for number, snap in enumerate(picked_now)
        ]
        set_to(self._picked, content=html.facts(rows, "picked") if rows else "")
        set_to(self._form, visible=bool(self._typed))
        if self._typed:
            words = tuple(typed.words for typed in self._typed)
            kept = self._what.value if self._what.value in words else words[0]
            choose(self._what, words, kept, False)
            self._show_value(next(typed for typed in self._typed if typed.words == kept))
        assumed = assumed_faces(shown.sources) if shown is not None else ()
        picked = state.model.picked[-1] if state.model.picked else None
        on_face = picked is not None and picked.kind == "plane" and picked.owner == MODEL
        set_to(self._confirm, visible=on_face and picked is not None and picked.number in assumed)

    def _show_value(self, typed: Typed | None) -> None:
        if typed is None:
            return
        number = 1e3 * typed.now if typed.unit == "m" else float(np.rad2deg(typed.now))
        set_to(self._value, label="Exactly (mm)" if typed.unit == "m" else "Exactly (deg)", value=round(number, 2) + 0.0)

    def _show_sources(self, state: State) -> None:
        busy, draft = state.job is not None, state.session.draft
        more = draft is not None and bool(draft.scans)
        set_to(self._scan, disabled=busy, label="Scan the cell again" if more else "Scan the cell")
        set_to(self._turn, disabled=busy, visible=bool(state.session.workcell.setup.bodies))
        set_to(self._upload, disabled=state.model.reading is not None)
        set_to(self._unit, value=state.model.unit)
        set_to(self._example, visible=draft is None, disabled=busy)
        set_to(self._open, visible=draft is not None and not state.model.open)
        set_to(self._close, visible=state.modelling)
        set_to(self._new, visible=draft is not None)


def _usable(state: State) -> tuple[str, ...]:
    """The tools that can do something now."""
    shown, draft = derived.built(state), derived.draft_of(state)
    if shown is None or draft is None:
        return ()
    usable = [SELECT, BOX, SKETCH, "measure"]
    usable += [EXTRUDE] if shown.sketches else []
    usable += [CUT, MIRROR] if shown.solid is not None else []
    return (*usable, POINTS) if unaligned(draft) is not None else tuple(usable)


def _looks(state: State) -> tuple:
    look = state.model
    tool = look.open, look.tool, look.clicks, look.drawing, look.picked, look.settings, look.step, look.alternative
    under_way = look.worked, look.patches, look.reading, look.waiting, look.unit, look.trial, look.mesh
    return (*map(id, tool), *map(id, under_way), id(state.session.draft), state.loads, state.job, state.undo, state.redo)
