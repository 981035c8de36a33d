"""The ledger as a tree: what was tried below what, for browsing it level by level."""

from collections.abc import Sequence
from functools import lru_cache

from handey_studio.base import Entry

ROOT = -1


@lru_cache(maxsize=4)
def children_of(entries: tuple[Entry, ...]) -> dict[int, tuple[Entry, ...]]:
    """The entries below each entry's id, and below `ROOT` those that stand by themselves, in the order in which they were tried."""
    below: dict[int, list[Entry]] = {}
    known = {entry.id for entry in entries}
    for entry in entries:
        below.setdefault(entry.parent if entry.parent in known and entry.parent is not None else ROOT, []).append(entry)
    return {parent: tuple(found) for parent, found in below.items()}


@lru_cache(maxsize=4)
def sizes_below(entries: tuple[Entry, ...]) -> dict[int, tuple[int, int]]:
    """How many entries are below each entry at any depth, and how many of them fell."""
    counts: dict[int, list[int]] = {}
    for entry in reversed(entries):  # whatever is below an entry was written after it
        mine = counts.setdefault(entry.id, [0, 0])
        if entry.parent is not None:
            above = counts.setdefault(entry.parent, [0, 0])
            above[0] += mine[0] + 1
            above[1] += mine[1] + (entry.reason is not None)
    return {number: (total, fell) for number, (total, fell) in counts.items()}


def path_to(entries: Sequence[Entry], number: int) -> tuple[Entry, ...]:
    """The entries from the root down to one, itself last; empty for `ROOT` and for numbers that are not there."""
    known = {entry.id: entry for entry in entries}
    path: list[Entry] = []
    while number in known and known[number] not in path:
        path.append(known[number])
        parent = known[number].parent
        number = ROOT if parent is None else parent
    return tuple(reversed(path))
