"""Disturb the cell: whether it obeys forces, and what goes wrong in it on purpose."""

from typing import Any

import viser

from handey_studio.app import html, palette
from handey_studio.app.disturbing import CALL_WORDS, CALLS, KINDS, AddFault, ClearFaults, SetPhysics, kind_of, which_words, words_of
from handey_studio.app.state import State
from handey_studio.app.wire import Send, on_click, on_user, set_to
from handey_studio.task.plan import MovePlan

PHYSICS_ON = "The arm is driven joint by joint, the hand holds by friction alone, and whatever is let go falls, slips or tips."
PHYSICS_OFF = "The arm follows exactly and what it holds is fixed to the hand; only some disturbances can happen then."
NONE_SET = "Nothing is set; the cell does what it should."


class DisturbingPanel:
    """Physics on or off, one disturbance at a time, and those that are set."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._physics = gui.add_checkbox("Physics", False)
        self._about = gui.add_html("")
        self._kind = gui.add_dropdown("Disturbance", tuple(kind.name for kind in KINDS))
        self._what = gui.add_html("")
        self._size: Any = gui.add_number("Size", 0.0, step=1.0)
        self._call = gui.add_dropdown("During", tuple(CALL_WORDS[call] for call in CALLS))
        self._count: Any = gui.add_number("Which of them", 1, min=1, max=999, step=1, hint="The first, second, third … in a MOVE")
        self._which = gui.add_html("")
        self._after: Any = gui.add_number("After (s)", 0.2, min=0.0, max=600.0, step=0.1)
        self._add = gui.add_button("Disturb", icon=viser.Icon.BOLT, color=palette.ARM_DARK)
        self._set = gui.add_html("")
        self._clear = gui.add_button("Clear all disturbances", color="gray", visible=False)
        self._plan: MovePlan | None = None
        self._choose(KINDS[0].name)
        on_user(self._call, send, lambda _: self._tell_which())
        on_user(self._physics, send, lambda event: SetPhysics(bool(event.target.value)))
        on_user(self._kind, send, lambda event: self._choose(event.target.value))
        on_click(self._add, send, lambda _: self._typed())
        on_click(self._clear, send, lambda _: ClearFaults())

    def _choose(self, name: str) -> None:
        """The fields for a kind, as it usually comes."""
        kind = kind_of(name)
        self._size.label = kind.size
        self._size.value, self._count.value = kind.usual, kind.count
        self._call.value = CALL_WORDS[kind.call]
        self._what.content = _small(kind.what)
        self._tell_which()

    def _tell_which(self) -> None:
        set_to(self._which, content=_small(which_words(self._plan, self._called()), "which"))

    def _typed(self) -> AddFault:
        return AddFault(self._kind.value, float(self._size.value), self._called(), int(self._count.value), float(self._after.value))

    def _called(self) -> str:
        return next(call for call in CALLS if CALL_WORDS[call] == self._call.value)

    def render(self, old: State | None, new: State) -> None:
        setup = new.session.workcell.setup
        self._plan = new.attempt.plan if new.attempt is not None else None
        self._tell_which()
        busy = new.job is not None
        set_to(self._physics, value=setup.physics, disabled=busy)
        set_to(self._about, content=_small(PHYSICS_ON if setup.physics else PHYSICS_OFF))
        set_to(self._add, disabled=busy)
        set_to(self._set, content=faults_html(new))
        set_to(self._clear, visible=bool(setup.faults), disabled=busy)


def faults_html(state: State) -> str:
    """What is set."""
    faults = state.session.workcell.setup.faults
    if not faults:
        return _small(NONE_SET, "faults")
    rows = "".join(f"<div>⚡ {html.esc(words_of(fault))}</div>" for fault in faults)
    return f'<div data-testid="faults" style="margin:2px 14px;font-size:12px;line-height:1.5">{rows}</div>'


def _small(text: str, testid: str = "") -> str:
    return f'<div data-testid="{testid}" style="margin:0 14px 4px;font-size:12px;line-height:1.4;color:var(--muted)">{html.esc(text)}</div>'
