"""The right panel's head: the session's name, New, Open, Save, Save as, Download, Upload."""

from typing import Any

import viser

from handey_studio.app import html
from handey_studio.app.autosave import LetGo, TakeUp
from handey_studio.app.panels.help import show_guide, show_keys
from handey_studio.app.session_actions import DownloadSession, NewSession, OpenSession, SaveSession, SaveSessionAs, UploadSession
from handey_studio.app.state import State
from handey_studio.app.wire import Send, on_click, on_upload, set_to

TAKE_UP, LET_GO = "Take it up", "Discard it"
LEFT = ("Something was not saved", "The workbench ended before a session was saved; a working copy of it is there.")
BUTTONS = (("File", ("New", "Open", "Save", "Save as")), ("More", ("Download", "Guide", "Keys")))
MODEL_OPEN = "A model is open: Part tells of it, the other panes of the MOVE before."


class SessionPanel:
    """Dialogs open in the browser that asked for them."""

    def __init__(self, server: viser.ViserServer, send: Send) -> None:
        gui = server.gui
        self._server, self._send = server, send
        self._state: State | None = None
        self._left = gui.add_html("", visible=False)
        self._leaving = gui.add_button_group("Left behind", (TAKE_UP, LET_GO), visible=False)
        on_click(self._leaving, send, lambda event: TakeUp() if event.target.value == TAKE_UP else LetGo())
        self._about = gui.add_html("")
        for label, choices in BUTTONS:
            on_click(gui.add_button_group(label, choices), send, self._pressed)

    def _pressed(self, event: Any) -> Any:
        choice = event.target.value
        if choice == "Open":
            self.ask_open(event.client)
        elif choice == "Save as":
            self.ask_name(event.client)
        elif choice == "Guide" and event.client is not None:
            show_guide(event.client)
        elif choice == "Keys" and event.client is not None:
            show_keys(event.client)
        return {"New": NewSession(), "Save": SaveSession(), "Download": DownloadSession(event.client_id)}.get(choice)

    def ask_open(self, client: viser.ClientHandle | None) -> None:
        """A dialog with the library's sessions."""
        if client is None or self._state is None:
            return
        names = tuple(sorted(self._state.library.sessions()))
        modal = client.gui.add_modal("Open a session")
        with modal:
            if not names:
                client.gui.add_html(html.empty("The library has no sessions yet. Save this one, or upload a file."))
            choice = client.gui.add_dropdown("Name", names or ("–",), disabled=not names)
            confirm = client.gui.add_button("Open this session", icon=viser.Icon.FOLDER_OPEN, disabled=not names)
            upload = client.gui.add_upload_button("Upload a file …", icon=viser.Icon.UPLOAD, mime_type=".handey")
            close = client.gui.add_button("Close", color="gray")
        self._close_with(modal, confirm, lambda: OpenSession(choice.value))
        on_upload(upload, self._uploaded(modal), lambda event: UploadSession(event.target.value.name, event.target.value.content))
        self._close_with(modal, close, lambda: None)

    def ask_name(self, client: viser.ClientHandle | None) -> None:
        """A dialog for a new name."""
        if client is None or self._state is None:
            return
        modal = client.gui.add_modal("Save as")
        with modal:
            name = client.gui.add_text("Name", self._state.session.name)
            confirm = client.gui.add_button("Save under this name", icon=viser.Icon.DEVICE_FLOPPY)
            close = client.gui.add_button("Close", color="gray")
        self._close_with(modal, confirm, lambda: SaveSessionAs(name.value))
        self._close_with(modal, close, lambda: None)

    def _uploaded(self, modal: Any) -> Send:
        def send(command: Any) -> None:
            modal.close()
            self._send(command)

        return send

    def _close_with(self, modal: Any, button: Any, make: Any) -> None:
        def pressed(_: Any) -> Any:
            command = make()
            modal.close()
            return command

        on_click(button, self._send, pressed)

    def render(self, old: State | None, new: State) -> None:
        self._state = new
        offered = new.left_behind is not None
        set_to(self._left, visible=offered, content=html.card(*LEFT, "info", "left-behind") if offered else "")
        set_to(self._leaving, visible=offered)
        if old is not None and _looks(old) == _looks(new):
            return
        mark = " *" if new.unsaved else ""
        self._server.gui.set_panel_label(f"Handey Studio – {new.session.name}{mark}")
        model = f'<div style="margin:0 14px 4px;font-size:12px;color:var(--muted)">{MODEL_OPEN}</div>' if new.modelling else ""
        self._about.content = html.facts(_about(new), "session-about") + model


def _about(state: State) -> list[tuple[str, str]]:
    session = state.session
    saved = " (not saved)" if state.unsaved else ""
    what = f"{session.name}{saved}: {session.workcell.robot}, {', '.join(session.workcell.parts) or 'no parts'}"
    viewers = [("Viewers", str(state.viewers))] if state.viewers > 1 else []
    return [("Session", what), *viewers]


def _looks(state: State) -> tuple:
    session = state.session
    return session.name, state.unsaved, session.workcell.robot, session.workcell.parts, state.viewers, state.modelling
