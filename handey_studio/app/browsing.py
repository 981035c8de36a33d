"""Browsing what was weighed: which hypotheses are listed, which entries of the ledger, which page of them, which data edges are shown."""

from collections.abc import Sequence

from handey_studio.app.state import State
from handey_studio.base import Entry, rejected_counts
from handey_studio.session.ledger_tree import children_of
from handey_studio.session.looking import browsed

ROWS = 6  # hypotheses on a page of the list
LEDGER_ROWS = 9  # entries on a page of the ledger


def browsed_hypotheses(state: State) -> tuple[int, ...]:
    """Numbers of the hypotheses that the filter leaves, best first."""
    return browsed(state.session.scene, state.hypothesis_part, state.hypothesis_verdict)


def page_of(state: State) -> tuple[int, ...]:
    """The page of them that holds the one that is looked at, or the first."""
    listed, now = browsed_hypotheses(state), state.session.view.hypothesis
    first = ROWS * (listed.index(now) // ROWS) if now in listed else 0
    return listed[first : first + ROWS]


def wired(state: State) -> tuple[int, ...]:
    """The hypotheses that stand in the scene as wires: all that are listed, while one is looked at."""
    hidden = state.session.view.hidden_layers
    if state.hypothesis is None or "other hypotheses" in hidden:
        return ()
    return browsed_hypotheses(state)


def edges_shown(state: State) -> list[int]:
    """Numbers of the data edges that are long enough to be shown."""
    scene = state.session.scene
    if scene is None or "data edges" in state.session.view.hidden_layers:
        return []
    return [number for number, edge in enumerate(scene.located.edges) if edge.length >= state.edge_min_m]


def ledger_of(state: State) -> tuple[Entry, ...]:
    """What the result that is looked at tells of all that was tried."""
    return state.session.result.ledger if state.session.result else ()


def filtered(state: State) -> bool:
    """Whether the ledger is a list of what was searched for, and not a tree."""
    return bool(state.ledger_stage or state.ledger_words or state.ledger_reason) or state.ledger_only != "all"


def listed(state: State) -> Sequence[Entry]:
    """The entries that are listed: those that pass the filter, else the branches of the entry that is open."""
    entries = ledger_of(state)
    if filtered(state):
        return [entry for entry in counted(state) if state.ledger_reason in ("", entry.reason)]
    return children_of(entries).get(state.ledger_at, ())


def counted(state: State) -> Sequence[Entry]:
    """The entries whose reasons are counted: those that pass the filter, whatever their reason."""
    return chosen(ledger_of(state), state.ledger_stage, state.ledger_only, state.ledger_words)


def reasons(state: State) -> list[tuple[str, int]]:
    """Each reason with how many entries fell for it, the most frequent first."""
    return list(rejected_counts(counted(state)).items())


def ledger_page(state: State) -> Sequence[Entry]:
    """The page of them that is shown."""
    return listed(state)[state.ledger_page * LEDGER_ROWS : (state.ledger_page + 1) * LEDGER_ROWS]


def chosen(entries: Sequence[Entry], stage: str, only: str, words: str) -> list[Entry]:
    """The entries that pass the filter; every word must occur somewhere in an entry. A stage that no entry has filters nothing."""
    wanted, known = words.lower().split(), any(entry.stage == stage for entry in entries)
    return [
        entry
        for entry in entries
        if (not known or entry.stage == stage)
        and (only == "all" or (only == "fell") == (entry.reason is not None))
        and all(word in _text(entry) for word in wanted)
    ]


def _text(entry: Entry) -> str:
    return f"{entry.stage} {entry.option} {entry.reason or ''} {' '.join(entry.bodies)}".lower()
