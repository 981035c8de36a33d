"""The list of MOVE commands with how far each is; a click on a row sets it up above."""

from collections.abc import Sequence
from typing import Any

import viser

from handey_studio.app import html, palette
from handey_studio.app.actions import CancelMove
from handey_studio.app.page_style import in_a_row
from handey_studio.app.sequence import AddCommand, ChooseCommand, RemoveCommand, RunCommands, ShiftCommand, SkipCommand, StartOver
from handey_studio.app.state import State
from handey_studio.app.wire import Send, element_id, on_click, set_to
from handey_studio.app.wording import arrow_words
from handey_studio.session.sequence import next_command, states_of
from handey_studio.session.session import CommandState

ROWS = 16  # that are listed at once, around the one that is chosen
TWO_LINES = "display:-webkit-box;-webkit-line-clamp:2;-webkit-box-orient:vertical;overflow:hidden"
ADD, REMOVE, UP, DOWN = "Add", "Remove", "▲", "▼"
SKIP, OVER = "Skip", "Start over"
PRESSED = {ADD: AddCommand(), REMOVE: RemoveCommand(), UP: ShiftCommand(-1), DOWN: ShiftCommand(1), SKIP: SkipCommand(), OVER: StartOver()}
SIGNS = {
    "waiting": ("○", palette.GREY),
    "running": ("●", palette.BLUE),
    "done": ("✓", palette.TEAL),
    "postponed": ("↻", palette.ORANGE),
    "failed": ("✗", palette.VERMILLION),
    "skipped": ("–", palette.GREY),
}


class CommandsPanel:
    """The list, its editing, and Run, Step, Stop."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._list = gui.add_html("")
        self._rows = [gui.add_button(f"Command in row {row + 1}") for row in range(ROWS)]  # pressed by the list, which hides them
        self._edit = gui.add_button_group("List", (ADD, REMOVE, UP, DOWN))
        self._more = gui.add_button_group("Chosen", (SKIP, OVER), hint="Skip passes the chosen one over; Start over lets all wait again")
        self._run = gui.add_button(
            "Run all",
            icon=viser.Icon.PLAYER_TRACK_NEXT_FILLED,
            color=palette.BLUE,
            hint="What cannot be planned is postponed until others are done; ends when one goes wrong or nothing more can be done",
        )
        self._step = gui.add_button("Step", icon=viser.Icon.PLAYER_SKIP_FORWARD, color=palette.ARM_DARK, hint="Only the next command")
        self._stop = gui.add_button("Stop", icon=viser.Icon.PLAYER_STOP, color=palette.VERMILLION, visible=False)
        gui.add_html(in_a_row([element_id(self._run), element_id(self._step)]))
        self._first = 0
        for group in (self._edit, self._more):
            on_click(group, send, lambda event: PRESSED[event.target.value])
        on_click(self._run, send, lambda _: RunCommands())
        on_click(self._step, send, lambda _: RunCommands(step=True))
        on_click(self._stop, send, lambda _: CancelMove())
        for row, button in enumerate(self._rows):
            on_click(button, send, lambda _, row=row: ChooseCommand(self._first + row))

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        count, idle = len(new.session.commands), new.job is None
        self._first = max(0, min(new.command_number - ROWS // 2, count - ROWS))
        self._list.content = commands_html(new, self._first, [element_id(button) for button in self._rows])
        begun = any(state.status in ("done", "postponed", "failed", "skipped") for state in states_of(new.session))
        left = next_command(new.session) is not None
        set_to(self._run, label=_run_label(new) if begun else "Run all", visible=idle and count > 0, disabled=not left)
        set_to(self._step, visible=idle and count > 0, disabled=not left)
        set_to(self._stop, visible=not idle, disabled=bool(new.job and new.job.cancelling))
        set_to(self._edit, visible=idle)
        set_to(self._more, visible=idle)


def commands_html(state: State, first: int, buttons: Sequence[str]) -> str:
    """A row each; a click presses the button (an element's id) of its place."""
    session, hidden = state.session, html.hidden(buttons)
    if not session.commands:
        return hidden + html.empty("No command yet. Choose a part above, or press Add.", "commands-empty")
    states = states_of(session)
    shown = range(first, min(first + len(buttons), len(states)))
    rows = "".join(_row(state, number, states[number], button) for number, button in zip(shown, buttons, strict=False))
    over = sum(one.status in ("done", "skipped") for one in states)
    more = f", {shown.start + 1} to {shown.stop} are shown" if len(shown) < len(states) else ""
    head = f'<div style="color:var(--muted);margin:0 2px 3px">{over} of {len(states)} done{more}</div>'
    return f'{hidden}<div data-testid="commands" style="margin:2px 12px 4px;font-size:12px;line-height:1.35">{head}{rows}</div>'


def _row(state: State, number: int, told: CommandState, button: str) -> str:
    command, chosen = state.session.commands[number], number == state.command_number
    sign, colour = SIGNS[told.status]
    look = html.row_look(chosen)
    clipped = "overflow:hidden;text-overflow:ellipsis;white-space:nowrap"
    why = state.session.results[told.result].reason if told.result >= 0 else ""
    below = (
        f'<div style="color:{palette.text(colour)};padding-left:34px;font-size:11.5px;{TWO_LINES}">{html.esc(why)}</div>'
        if told.status in ("postponed", "failed")
        else ""
    )
    words = html.esc(arrow_words(command))
    return (
        f'<div data-testid="command-{number}" data-status="{told.status}" role="button" tabindex="0" title="{words}: {told.status}" '
        f'onclick="{html.esc(html.pressing(button))}" style="cursor:pointer;{look};padding:2px 8px">'
        f'<div style="display:flex;gap:6px"><span style="color:{palette.text(colour)};width:12px">{sign}</span>'
        f'<span style="color:var(--faint);width:16px">{number + 1}</span><span style="flex:1;{clipped}">{words}</span></div>{below}</div>'
    )


def _run_label(state: State) -> str:
    number = next_command(state.session)
    return "All done" if number is None else f"Resume at {number + 1}"


def _looks(state: State) -> tuple[Any, ...]:
    session = state.session
    return state.loads, session.commands, session.states, tuple(map(id, session.results)), state.job, state.command_number
