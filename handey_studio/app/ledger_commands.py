"""Browsing the ledger: down to a branch, up again, page by page, or a search through all of it."""

from dataclasses import dataclass, replace

from handey_studio.app.browsing import LEDGER_ROWS, filtered, ledger_of, ledger_page, listed, reasons
from handey_studio.app.state import State
from handey_studio.session.ledger_tree import ROOT, children_of, path_to


@dataclass(frozen=True)
class FilterLedger:
    stage: str | None = None
    only: str | None = None
    words: str | None = None

    def apply(self, state: State) -> State:
        return replace(
            state,
            ledger_stage=state.ledger_stage if self.stage is None else self.stage,
            ledger_only=state.ledger_only if self.only is None else self.only,
            ledger_words=state.ledger_words if self.words is None else self.words[:80],
            ledger_page=0,
        )


@dataclass(frozen=True)
class LedgerReason:
    """List what fell for the reason in a row of the reasons; again: no longer."""

    row: int

    def apply(self, state: State) -> State:
        known = [reason for reason, _ in reasons(state)]
        if not 0 <= self.row < len(known):
            return state
        reason = "" if known[self.row] == state.ledger_reason else known[self.row]
        return replace(state, ledger_reason=reason, ledger_page=0)


@dataclass(frozen=True)
class LedgerRow:
    """Look at the entry in a row of the ledger's page, and at what is below it."""

    row: int

    def apply(self, state: State) -> State:
        page = ledger_page(state)
        if not 0 <= self.row < len(page):
            return state
        entry = page[self.row]
        state = replace(state, ledger_entry=entry.id)
        if filtered(state) or entry.id not in children_of(ledger_of(state)):
            return state
        return replace(state, ledger_at=entry.id, ledger_page=0)


@dataclass(frozen=True)
class LedgerUp:
    """Back to the branches that the one listed belongs to; its top at last looks at nothing."""

    def apply(self, state: State) -> State:
        path = path_to(ledger_of(state), state.ledger_at)
        above = path[-2].id if len(path) > 1 else ROOT
        return replace(state, ledger_at=above, ledger_page=0, ledger_entry=above)


@dataclass(frozen=True)
class LedgerPage:
    """The next page of entries (+1) or the one before (−1)."""

    by: int

    def apply(self, state: State) -> State:
        last = max(0, (len(listed(state)) - 1) // LEDGER_ROWS)
        return replace(state, ledger_page=min(max(state.ledger_page + self.by, 0), last))


@dataclass(frozen=True)
class LookAtEntry:
    """Look at an entry among the branches that it stands with, whatever was searched for before."""

    number: int

    def apply(self, state: State) -> State:
        entry = next((entry for entry in ledger_of(state) if entry.id == self.number), None)
        if entry is None:
            return state
        above = path_to(ledger_of(state), entry.id)[:-1]
        at = above[-1].id if above else ROOT
        page = children_of(ledger_of(state))[at].index(entry) // LEDGER_ROWS
        state = replace(state, ledger_stage="", ledger_only="all", ledger_words="", ledger_reason="")
        return replace(state, ledger_at=at, ledger_page=page, ledger_entry=entry.id)


@dataclass(frozen=True)
class LookAtNoEntry:
    """The scene shows the plan again, not what fell."""

    def apply(self, state: State) -> State:
        return replace(state, ledger_entry=ROOT)
