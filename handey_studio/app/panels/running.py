"""What was noticed while a MOVE was carried out, and what was decided then: rows to be clicked, each seeks the timeline there."""

from collections.abc import Sequence

import numpy as np
import viser

from handey_studio.app import html, palette
from handey_studio.app.happened import MOST_ROWS, Happening, LookAtHappening, happenings
from handey_studio.app.palette import css
from handey_studio.app.state import State
from handey_studio.app.wire import Send, element_id, on_click
from handey_studio.task.plan import MoveResult

SIGNS = {
    "incident": ("✕", palette.VERMILLION),
    "overcome": ("!", palette.ORANGE),
    "decision": ("↻", palette.BLUE),
    "given up": ("■", palette.VERMILLION),
    "check": ("✓", palette.TEAL),
    "unsure": ("?", palette.ORANGE),
}
SMOOTH = "Nothing went otherwise than planned."


class HappenedPanel:
    """The rows of the result that is looked at."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._list = gui.add_html("")
        self._rows = [gui.add_button(f"Happening in row {row + 1}") for row in range(MOST_ROWS)]  # pressed by the list, which hides them
        for row, button in enumerate(self._rows):
            on_click(button, send, lambda _, row=row: LookAtHappening(row))

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        self._list.content = happened_html(new, [element_id(button) for button in self._rows])


def happened_html(state: State, buttons: Sequence[str]) -> str:
    """A row each; a click presses the button (an element's id) of its place."""
    result, hidden = state.session.result, html.hidden(buttons)
    if result is None or not result.performances:
        return hidden
    rows = happenings(state)
    count, most = len(state.attempts), max(performance.tracking.hand_mm for performance in result.performances)
    head = html.heading("What happened") + html.facts(_facts(result, most), "performed-facts")
    if not any(row.kind != "check" for row in rows):
        head += html.card("As planned", SMOOTH, "good", "as-planned")
    told = "".join(_row(row, count, number, button) for number, (row, button) in enumerate(zip(rows, buttons, strict=False)))
    return f'{hidden}{head}<div data-testid="happened" style="margin:2px 12px 6px;font-size:12px;line-height:1.35">{told}</div>'


def _facts(result: MoveResult, most_mm: float) -> list[tuple[str, str]]:
    seconds = sum(performance.seconds for performance in result.performances)
    turned = max(performance.tracking.joint_rad for performance in result.performances)
    count = len(result.performances)
    physics = "simulated with physics" if result.physics else "followed exactly, grips geometric (no physics)"
    return [
        (
            "Carried out",
            f"in {seconds:.1f} s of the cell's time, gripping and feeling included; {count} attempt{'s' * (count > 1)}",
        ),
        ("Tracked", f"within {most_mm:.1f} mm and {np.rad2deg(turned):.2f}° of the command"),
        ("Cell", physics),
    ]


def _row(row: Happening, count: int, number: int, button: str) -> str:
    sign, colour = SIGNS[row.kind]
    when = f"{f'attempt {row.attempt + 1}, ' if count > 1 else ''}{row.time_s:.1f} s"
    return (
        f'<div data-testid="happened-{number}" role="button" tabindex="0" onclick="{html.esc(html.pressing(button))}" '
        f'style="cursor:pointer;border-left:3px solid {css(colour)};padding:3px 8px;margin-bottom:3px;border-radius:3px;'
        f'background:var(--row)">'
        f'<div style="display:flex;gap:6px"><span style="color:{palette.text(colour)};width:12px">{sign}</span>'
        f'<b style="font-weight:600;flex:1">{html.esc(row.title)}</b>'
        f'<span style="color:var(--muted);white-space:nowrap">{when}</span></div>'
        f'<div style="color:var(--body);padding-left:18px;font-size:11.5px">{html.esc(html.sentence(row.sentence))}</div></div>'
    )


def _looks(state: State) -> tuple:
    return state.loads, id(state.session.result)
