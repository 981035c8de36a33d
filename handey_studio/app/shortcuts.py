"""Keyboard commands; the palette (Ctrl+K) lists them all. W A S D Q E and the arrows belong to the browser's camera."""

from typing import Any

import viser

from handey_studio.app.actions import StartMove
from handey_studio.app.commands import Redo, Undo
from handey_studio.app.looking_at import Browse, LookAt
from handey_studio.app.modelling.accepting import Accept, Escape
from handey_studio.app.modelling.steps import RemovePicked
from handey_studio.app.panels.session import SessionPanel
from handey_studio.app.playback import SeekStep, TogglePlay
from handey_studio.app.ruler import ToggleRuler
from handey_studio.app.session_actions import SaveSession
from handey_studio.app.viewpoints import Follow, LookFrom
from handey_studio.app.wire import Send, on_trigger

KEYS: tuple[tuple[str, Any, Any, Any], ...] = (
    ("Save the session", "S", "cmd/ctrl", SaveSession()),
    ("Undo", "Z", "cmd/ctrl", Undo()),
    ("Redo", "Z", "cmd/ctrl+shift", Redo()),
    ("Play or pause", "space", None, TogglePlay()),
    ("Step back", "J", None, SeekStep(-1)),
    ("Step on", "L", None, SeekStep(1)),
    ("To the start", "home", None, SeekStep(-99)),
    ("To the end", "end", None, SeekStep(99)),
    ("Plan", "P", None, StartMove(execute=False)),
    ("MOVE", "M", None, StartMove(execute=True)),
    ("Take up the ruler, or put it away", "R", None, ToggleRuler()),
    ("Look at no hypothesis", "0", None, LookAt(-1)),
    ("Cancel planning, or put the modeller's tool down", "escape", None, Escape()),
    ("Take what the modeller offers, or finish its tool", "enter", None, Accept()),
    ("Delete the step that is looked at, or the solid", "delete", None, RemovePicked()),
)
BROWSE_KEYS: tuple[tuple[str, Any, int], ...] = (("Next hypothesis", "N", 1), ("Hypothesis before", "B", -1))
VIEW_KEYS: tuple[tuple[Any, str], ...] = (
    ("1", "Workcell"),
    ("2", "Pile"),
    ("3", "Top"),
    ("4", "Grasp"),
    ("5", "Hand"),
    ("6", "Hypothesis"),
    ("7", "C-space"),
)


def add_shortcuts(gui: viser.GuiApi, send: Send, session: SessionPanel) -> None:
    """Register every command with its key."""
    for label, key, modifier, command in KEYS:
        on_trigger(gui.add_command(label, hotkey=key, modifier=modifier), send, lambda _, command=command: command)
    for label, key, by in BROWSE_KEYS:
        on_trigger(gui.add_command(label, hotkey=key), send, lambda event, by=by: Follow(Browse(by), event.client_id))
    for key, view in VIEW_KEYS:
        on_trigger(gui.add_command(f"Look: {view}", hotkey=key), send, lambda event, view=view: LookFrom(view, event.client_id))
    opening = gui.add_command("Open a session", hotkey="O", modifier="cmd/ctrl")
    on_trigger(opening, send, lambda event: session.ask_open(event.client))
