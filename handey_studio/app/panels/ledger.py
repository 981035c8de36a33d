"""The ledger as a list: what was tried, and why each candidate fell."""

from collections.abc import Sequence
from typing import Any

import viser

from handey_studio.app import html, palette
from handey_studio.app.commands import FilterLedger
from handey_studio.app.palette import css
from handey_studio.app.state import State
from handey_studio.app.wire import Send, on_user, set_to
from handey_studio.base import Entry, describe, rejected_counts

ALL_STAGES = "all stages"
ONLY = ("all", "fell", "stood")
MAX_ROWS, MAX_REASONS, MAX_DEPTH = 80, 8, 12


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
        self._list.content = ledger_html(picked, entries) if entries else html.empty(NOTHING, "ledger-empty")


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


def ledger_html(entries: Sequence[Entry], whole: Sequence[Entry]) -> str:
    """Reasons by count, then rows grouped by stage. `whole` is the unfiltered ledger, which knows the entries' parents."""
    counts = list(rejected_counts(entries).items())
    most = max((count for _, count in counts), default=1)
    bars = "".join(html.count_row(reason, count, most, palette.VERMILLION) for reason, count in counts[:MAX_REASONS])
    head = f'<div style="color:#6b7684;margin:6px 0">{len(entries)} of {len(whole)} entries.</div>'
    return (
        f'<div data-testid="ledger" style="margin:4px 14px;font-size:12px;line-height:1.4">{bars}{head}'
        f'<div style="max-height:420px;overflow:auto">{_groups(entries, {entry.id: entry for entry in whole})}</div></div>'
    )


def _groups(entries: Sequence[Entry], known: dict[int, Entry]) -> str:
    """One heading a stage, in the order in which stages first ran, with its entries below."""
    stages: dict[str, list[Entry]] = {}
    for entry in entries:
        stages.setdefault(entry.stage, []).append(entry)
    groups = []
    for stage, members in stages.items():
        fell = sum(entry.reason is not None for entry in members)
        name = stage[:1].upper() + stage[1:]
        heading = f'{html.esc(name)} <span style="font-weight:400;color:#6b7684">{len(members)} tried, {fell} fell</span>'
        more = len(members) - MAX_ROWS
        rest = f'<div style="color:#6b7684">and {more} more; narrow it down above</div>' if more > 0 else ""
        rows = "".join(_row(entry, known) for entry in members[:MAX_ROWS])
        groups.append(f'<div style="font-weight:650;margin:8px 0 2px">{heading}</div>{rows}{rest}')
    return "".join(groups)


def _row(entry: Entry, known: dict[int, Entry]) -> str:
    """A mark that says whether it fell, the option and what it belongs to, and below it the reason with value and limit."""
    fell = entry.reason is not None
    colour, sign = (palette.VERMILLION, "✕") if fell else (palette.TEAL, "●")
    mark = f'<span style="color:{css(colour)};display:inline-block;width:18px">{sign}</span>'
    owner = html.esc(context(entry, known))
    below = [f'<div style="color:#97a1ad;padding-left:18px">{owner}</div>'] if owner else []
    below += [f'<div style="color:#6b7684;padding-left:18px">{html.esc(describe(entry))}</div>'] if fell else []
    return f'<div style="padding:2px 0;border-bottom:1px solid #eef1f4">{mark}{html.esc(entry.option)}{"".join(below)}</div>'


def context(entry: Entry, known: dict[int, Entry]) -> str:
    """What an entry belongs to: the options above it, outermost first, without the outermost of all, which is always the same."""
    names: list[str] = []
    while entry.parent is not None and entry.parent in known and len(names) < MAX_DEPTH:
        entry = known[entry.parent]
        names.append(entry.option)
    return " › ".join(names[-2::-1])


def _text(entry: Entry) -> str:
    return f"{entry.stage} {entry.option} {entry.reason or ''} {' '.join(entry.bodies)}".lower()


def _looks(state: State) -> tuple:
    return state.session.result, state.ledger_stage, state.ledger_only, state.ledger_words
