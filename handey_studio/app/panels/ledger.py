"""The ledger: a tree of everything that was tried, with the reason of each branch that fell; a click shows the failure in the scene."""

from collections.abc import Sequence
from typing import Any

import viser

from handey_studio.app import html, palette
from handey_studio.app.browsing import LEDGER_ROWS, filtered, ledger_of, ledger_page, listed, reasons
from handey_studio.app.ledger_commands import FilterLedger, LedgerPage, LedgerReason, LedgerRow, LedgerUp, LookAtNoEntry
from handey_studio.app.state import State
from handey_studio.app.wire import Send, element_id, on_click, on_user, set_to
from handey_studio.base import Entry, describe
from handey_studio.session.ledger_tree import path_to, sizes_below

ALL_STAGES = "all stages"
ONLY = ("all", "fell", "stood")
MAX_REASONS, MAX_DEPTH = 6, 12
UP, BACK, ON, AWAY = "▲ Up", "◀ Prev", "Next ▶", "Clear"
PRESSED = {UP: LedgerUp(), BACK: LedgerPage(-1), ON: LedgerPage(1), AWAY: LookAtNoEntry()}
STOOD = {"step": "done", "recovery": "done"}  # what was carried out was no option any more
NOTHING = "Nothing was tried yet. After Plan or MOVE this is the tree of every option, and why each branch fell."


class LedgerPanel:
    """Counts of reasons, the branches with their buttons, and the entry that is looked at."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._stage: Any = gui.add_dropdown("Stage", (ALL_STAGES,))
        self._only = gui.add_dropdown("Entries", ONLY)
        self._words = gui.add_text("Find", "")
        self._list = gui.add_html("")
        self._rows = [gui.add_button(f"Entry in row {row + 1}") for row in range(LEDGER_ROWS)]  # pressed by the list, which hides them
        self._reasons = [gui.add_button(f"Reason in row {row + 1}") for row in range(MAX_REASONS)]
        self._browse = gui.add_button_group("Branches", (UP, BACK, ON, AWAY), hint="A row with ▸ opens what was tried below it")
        self._about = gui.add_html("")
        on_user(self._stage, send, lambda event: FilterLedger(stage="" if event.target.value == ALL_STAGES else event.target.value))
        on_user(self._only, send, lambda event: FilterLedger(only=event.target.value))
        on_user(self._words, send, lambda event: FilterLedger(words=event.target.value))
        on_click(self._browse, send, lambda event: PRESSED[event.target.value])
        for row, button in enumerate(self._rows):
            on_click(button, send, lambda _, row=row: LedgerRow(row))
        for row, button in enumerate(self._reasons):
            on_click(button, send, lambda _, row=row: LedgerReason(row))

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        entries = ledger_of(new)
        stages = (ALL_STAGES, *dict.fromkeys(entry.stage for entry in entries))
        if tuple(self._stage.options) != stages:
            self._stage.options = stages
        set_to(self._stage, value=new.ledger_stage if new.ledger_stage in stages else ALL_STAGES)
        buttons, reasons = [element_id(button) for button in self._rows], [element_id(button) for button in self._reasons]
        for widget in (self._stage, self._only, self._words, self._browse):
            set_to(widget, visible=bool(entries))
        self._list.content = (
            ledger_html(new, buttons, reasons) if entries else html.hidden((*buttons, *reasons)) + html.empty(NOTHING, "ledger-empty")
        )
        self._about.content = entry_html(new.entry, entries) if new.entry is not None else ""


def ledger_html(state: State, buttons: Sequence[str], pressed: Sequence[str]) -> str:
    """Reasons by count, the way down to the branches that are listed, then a row each; a click presses the button of its place, `pressed`
    those of the reasons."""
    entries, page, every = ledger_of(state), ledger_page(state), listed(state)
    below = sizes_below(entries)
    rows = "".join(_row(entry, below[entry.id], entry.id == state.ledger_entry, b) for entry, b in zip(page, buttons, strict=False))
    first = state.ledger_page * LEDGER_ROWS
    head = f"{first + 1} to {first + len(page)} of {len(every)}" if page else "none"
    where = f"{len(every)} of {len(entries)} entries match; {head}" if filtered(state) else f"{_trail(state)}: {head}"
    return (
        f'{html.hidden((*buttons, *pressed))}<div data-testid="ledger" style="margin:4px 14px;font-size:12px;line-height:1.4">'
        f"{_reason_rows(state, pressed)}"
        f'<div style="color:var(--muted);margin:8px 0 3px">{where}</div>{rows}</div>'
    )


def _reason_rows(state: State, buttons: Sequence[str]) -> str:
    """A bar for each of the most frequent reasons; the one whose entries are listed is marked."""
    counts = reasons(state)
    most, left = max((count for _, count in counts), default=1), len(counts) - MAX_REASONS
    rows = "".join(
        html.count_row(reason, count, most, palette.VERMILLION, button, reason == state.ledger_reason)
        for (reason, count), button in zip(counts, buttons, strict=False)
    )
    return rows + (f'<div style="color:var(--muted)">and {left} more reasons: Find, above, looks for words</div>' if left > 0 else "")


def _trail(state: State) -> str:
    """The options down to the one whose branches are listed."""
    path = path_to(ledger_of(state), state.ledger_at)
    return " › ".join(html.esc(entry.option) for entry in path) or f"{len(ledger_of(state))} entries in all; at the top"


def _row(entry: Entry, below: tuple[int, int], looked_at: bool, button: str) -> str:
    """A mark that says whether it fell, the option, how much was tried below it, and the reason with value and limit."""
    fell = entry.reason is not None
    colour, sign = (palette.VERMILLION, "✕") if fell else (palette.TEAL, "●")
    look = html.row_look(looked_at)
    more = f'<span style="color:var(--muted);white-space:nowrap">{below[0]} ▸</span>' if below[0] else ""
    stood = f"{below[1]} of {below[0]} below it fell" if below[0] else STOOD.get(entry.stage, "nothing speaks against it")
    said = html.esc(describe(entry) or stood)
    return (
        f'<div data-testid="entry-{entry.id}" role="button" tabindex="0" onclick="{html.esc(html.pressing(button))}" '
        f'style="cursor:pointer;{look};padding:3px 8px;margin-bottom:2px;border-radius:3px">'
        f'<div style="display:flex;gap:6px"><span style="color:{palette.text(colour)};width:12px">{sign}</span>'
        f'<span style="flex:1;overflow-wrap:anywhere"><span style="color:var(--faint)">{html.esc(entry.stage)}</span> '
        f"{html.esc(entry.option)}</span>"
        f'{more}</div><div style="color:var(--muted);padding-left:18px;font-size:11.5px">{said}</div></div>'
    )


def entry_html(entry: Entry, entries: Sequence[Entry]) -> str:
    """The entry that is looked at: what it belongs to, the reason with its number, and what the scene shows of it."""
    title = f"{entry.stage[:1].upper()}{entry.stage[1:]}: {entry.option}"
    said = describe(entry) or "Nothing speaks against it."
    card = html.card(title, said, "bad" if entry.reason else "good", "entry")
    rows = [("Belongs to", context(entry, {other.id: other for other in entries}) or "the MOVE itself")]
    if entry.reason and entry.posture is not None:
        rows.append(("In the scene", "the arm or hand as it stood then, what it met in red"))
    elif entry.reason and entry.bodies:
        rows.append(("In the scene", f"{' and '.join(entry.bodies)} in red"))
    return card + html.facts(rows, "entry-facts")


def context(entry: Entry, known: dict[int, Entry]) -> str:
    """What an entry belongs to: the options above it, outermost first."""
    names: list[str] = []
    while entry.parent is not None and entry.parent in known and len(names) < MAX_DEPTH:
        entry = known[entry.parent]
        names.append(entry.option)
    return " › ".join(reversed(names))


def _looks(state: State) -> tuple:
    filters = state.ledger_stage, state.ledger_only, state.ledger_words, state.ledger_reason
    return state.session.result, filters, state.ledger_at, state.ledger_page, state.ledger_entry
