"""Widgets to commands and back, with the few hooks into viser that are not public kept in one place."""

import json
import logging
from collections.abc import Callable
from typing import Any

import viser
from viser import _messages

log = logging.getLogger(__name__)

Send = Callable[[Any], None]


def on_user(handle: Any, send: Send, make: Callable[[Any], Any]) -> None:
    """Send `make(event)` when a user (not this program) changes the widget. Handlers run in order, and only enqueue."""

    async def changed(event: Any) -> None:
        if event.client is not None:
            command = make(event)
            if command is not None:
                send(command)

    handle.on_update(changed)


def on_click(handle: Any, send: Send, make: Callable[[Any], Any]) -> None:
    """Send `make(event)` when a button is pressed."""

    async def pressed(event: Any) -> None:
        command = make(event)
        if command is not None:
            send(command)

    handle.on_click(pressed)


def on_scene_click(server: viser.ViserServer, send: Send, make: Callable[[Any], Any], modifier: Any = None) -> None:
    """Send `make(event)` when a user clicks into the scene, with a key such as "shift" held down if one is named."""

    async def clicked(event: Any) -> None:
        send(make(event))

    handler: Any = clicked  # viser awaits it; its annotation speaks of plain functions only
    server.scene.on_click(modifier=modifier)(handler)


def on_upload(handle: Any, send: Send, make: Callable[[Any], Any]) -> None:
    """Send `make(event)` when a file has arrived."""

    async def arrived(event: Any) -> None:
        send(make(event))

    handle.on_upload(arrived)


def on_trigger(command: Any, send: Send, make: Callable[[Any], Any]) -> None:
    """Send `make(event)` when a keyboard command fires."""

    async def fired(event: Any) -> None:
        made = make(event)
        if made is not None:
            send(made)

    command.on_trigger(fired)


def element_id(handle: Any) -> str:
    """The id of a button in the page, empty when this version of viser has none."""
    return str(getattr(getattr(handle, "_impl", None), "uuid", ""))


def set_to(handle: Any, **properties: Any) -> None:
    """Assign only what differs, so that nothing is sent for nothing."""
    for key, value in properties.items():
        if getattr(handle, key) != value:
            setattr(handle, key, value)


SHOW_TABS = """
const pressTab = (label) => {
  const tab = [...document.querySelectorAll('[role=tab]')].find(tab => tab.textContent.trim() === label);
  if (tab && tab.getAttribute('aria-selected') !== 'true') {
    const kept = event => event.stopPropagation();
    document.body.addEventListener('keydown', kept);
    tab.dispatchEvent(new KeyboardEvent('keydown', {key: 'Enter', bubbles: true}));
    document.body.removeEventListener('keydown', kept);
    tab.click();
  }
  return tab;
};
const keep = () => sessionStorage.setItem('tabs in front', JSON.stringify(
  [...document.querySelectorAll('[role=tab][aria-selected=true]')].map(tab => tab.textContent.trim())));
const known = REMEMBERED ? JSON.parse(sessionStorage.getItem('tabs in front') || '[]') : [];
let wanted = known.length ? known : LABELS, tries = 0;
const waiting = setInterval(() => {
  wanted = wanted.filter(label => !pressTab(label));
  if (wanted.length && ++tries <= 100) return;
  clearInterval(waiting);
  window.onpagehide = keep;
}, 100);
"""  # a tab of a docked panel answers to keys and to the pointer, not to a plain click; the key must not reach the page's shortcuts


def show_tabs(client: viser.ClientHandle, *labels: str, remembered: bool = False) -> None:
    """Bring the tabs of those names to the front in one browser, or with `remembered`, those that were in front before its page was loaded
    anew; this version of viser has no call for it, so the page presses them itself."""
    _run_in_page(client, SHOW_TABS.replace("LABELS", json.dumps(labels)).replace("REMEMBERED", json.dumps(remembered)))


PAGE_KEYS = """
const tamed = event => {
  if (event.key === 'Enter' && event.target.matches('[role=button][onclick]')) {
    event.target.click();
    event.stopPropagation();
  }
  const dialog = [...document.querySelectorAll('[role=dialog]')].pop();
  if (!dialog) return;
  event.stopPropagation();
  if (event.key !== 'Escape') return;
  const close = [...dialog.querySelectorAll('button')].find(button => button.textContent.trim() === 'Close');
  if (close) close.click();
};
document.body.removeEventListener('keydown', window.tamedKeys);
document.body.addEventListener('keydown', window.tamedKeys = tamed);
"""  # the page's shortcuts listen further out


def tame_keys(client: viser.ClientHandle) -> None:
    """Enter presses the row of a list that has the focus. While a dialog is open its keys are its own, none a shortcut: Enter presses the
    button that has the focus, Escape closes it."""
    _run_in_page(client, PAGE_KEYS)


def _run_in_page(client: viser.ClientHandle, source: str) -> None:
    connection, message = getattr(client, "_websock_connection", None), getattr(_messages, "RunJavascriptMessage", None)
    if connection is None or message is None:
        log.warning("this version of viser runs no scripts: tabs stay where they are, and keys reach through dialogs")
        return
    connection.queue_message(message(source=source))


def close_share_tunnel(server: viser.ViserServer) -> None:
    """No browser may ask this program to open itself to the internet: the handler goes, not just its button."""
    websock = getattr(server, "_websock_server", None)
    if websock is None or not hasattr(websock, "unregister_handler"):
        log.warning("this version of viser has no share handler to close")
        return
    websock.unregister_handler(_messages.ShareUrlRequest)


def on_submit(form: Any, send: Send, make: Callable[[], Any]) -> None:
    """Send `make()` when a form is submitted, by Enter or by its button."""

    async def submitted(event: Any) -> None:
        command = make()
        if command is not None:
            send(command)

    form.on_submit(submitted)
