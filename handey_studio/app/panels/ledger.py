"""The ledger as a list: what was tried, and why each candidate fell."""

from collections.abc import Sequence
from typing import Any

import viser

from handey_studio.app import html, palette
from handey_studio.app.commands import FilterLedger
from handey_studio.app.palette import css
from handey_studio.app.state import State
from handey_studio.app.wire import Send, on_user, set_to
from handey_studio.base import Entry, rejected_counts

ALL_STAGES = "all stages"
ONLY = ("all", "fell", "stood")
MAX_ROWS = 250


class LedgerPanel:
    """Counts of reasons first, then the entries by stage."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._stage: Any = gui.add_dropdown("Stage", (ALL_STAGES,))
        self._only = gui.add_dropdown("Entries", ONLY)
        self._words = gui.add_text("Find", "")
        self._list = gui.add_html("")
        on_user(self._stage, send, lambda event: FilterLedger(stage="" if event.target.value == ALL_STAGES else event.target.value))
        on_user(self._only, send, lambda event: FilterLedger(only=event.target.value))
        on_user(self._words, send, lambda event: FilterLedger(words=event.target.value))

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        result = new.session.result
        entries = result.ledger if result else ()
        stages = (ALL_STAGES, *dict.fromkeys(entry.stage for entry in entries))
        if tuple(self._stage.options) != stages:
            self._stage.options = stages
        set_to(self._stage, value=new.ledger_stage if new.ledger_stage in stages else ALL_STAGES)
        picked = chosen(entries, new.ledger_stage if new.ledger_stage in stages else "", new.ledger_only, new.ledger_words)
        self._list.content = ledger_html(picked, len(entries)) if entries else html.empty(NOTHING, "ledger-empty")


NOTHING = "Nothing was tried yet. After Plan or MOVE this lists every candidate and why it fell."


def chosen(entries: Sequence[Entry], stage: str, only: str, words: str) -> list[Entry]:
    """The entries that pass the filter; every word must occur somewhere in an entry."""
    wanted = words.lower().split()
    return [
        entry
        for entry in entries
        if (not stage or entry.stage == stage)
        and (only == "all" or (only == "fell") == (entry.reason is not None))
        and all(word in _text(entry) for word in wanted)
    ]


def ledger_html(entries: Sequence[Entry], total: int) -> str:
    """Reasons by count, then rows grouped by stage."""
    counts = list(rejected_counts(entries).items())
    most = max((count for _, count in counts), default=1)
    bars = "".join(_count_row(reason, count, most) for reason, count in counts[:8])
    more = f" Showing the first {MAX_ROWS}; narrow it down above." if len(entries) > MAX_ROWS else ""
    head = f'<div style="color:#6b7684;margin:6px 0">{len(entries)} of {total} entries.{more}</div>'
    return (
        f'<div data-testid="ledger" style="margin:4px 14px;font-size:12px;line-height:1.4">{bars}{head}'
        f'<div style="max-height:380px;overflow:auto">{_rows(entries[:MAX_ROWS])}</div></div>'
    )


def _count_row(reason: str, count: int, most: int) -> str:
    width = max(3.0, 100.0 * count / most)
    clipped = "flex:0 0 62%;overflow:hidden;text-overflow:ellipsis;white-space:nowrap"
    bar = f'<div style="width:{width:.0f}%;background:{css(palette.VERMILLION)};height:8px;border-radius:3px"></div>'
    return (
        '<div style="display:flex;align-items:center;gap:8px;margin:2px 0">'
        f'<div style="{clipped}" title="{html.esc(reason)}">{html.esc(reason)}</div>'
        f'<div style="flex:1;background:#e6eaef;border-radius:3px">{bar}</div>'
        f'<div style="flex:0 0 34px;text-align:right;font-variant-numeric:tabular-nums">{count}</div></div>'
    )


def _rows(entries: Sequence[Entry]) -> str:
    rows, stage = [], None
    for entry in entries:
        if entry.stage != stage:
            stage = entry.stage
            rows.append(f'<div style="font-weight:650;margin:8px 0 2px;text-transform:capitalize">{html.esc(stage)}</div>')
        rows.append(_row(entry))
    return "".join(rows)


def _row(entry: Entry) -> str:
    """A dot that says whether it fell, the option, and below it the reason with value and limit."""
    fell = entry.reason is not None
    mark = f'<span style="color:{css(palette.VERMILLION)}">✕</span>' if fell else f'<span style="color:{css(palette.TEAL)}">●</span>'
    why = f'<div style="color:#6b7684;padding-left:18px">{html.esc(_reason(entry))}</div>' if fell else ""
    option = f'<span style="display:inline-block;width:18px">{mark}</span>{html.esc(entry.option)}'
    return f'<div style="padding:2px 0;border-bottom:1px solid #eef1f4">{option}{why}</div>'


def _reason(entry: Entry) -> str:
    words = entry.reason or ""
    if entry.value is not None:
        words += f": {html.number(entry.value, entry.unit)}"
        if entry.limit is not None:
            words += f", limit {html.number(entry.limit, entry.unit)}"
    return words + (f" ({' – '.join(entry.bodies)})" if entry.bodies else "")


def _text(entry: Entry) -> str:
    return f"{entry.stage} {entry.option} {entry.reason or ''} {' '.join(entry.bodies)}".lower()


def _looks(state: State) -> tuple:
    return state.session.result, state.ledger_stage, state.ledger_only, state.ledger_words
