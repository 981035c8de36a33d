"""The ledger: what a stage tried, and why each candidate fell.

Everyone in this field asks their planner "why not?". Every search writes an entry for each option it looks at; the
screen, the command line's JSON and the tests read these same entries.
"""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any


@dataclass(frozen=True)
class Posture:
    """How arm, hand and part stood when an option fell, so that it can be shown. Plain numbers; what is not known is empty.

    `q_rad` the arm's joints; or `T_world_hand`, the hand alone: sixteen numbers, row by row, as `T_world_part`, where `part` was.
    """

    q_rad: tuple[float, ...] = ()
    T_world_hand: tuple[float, ...] = ()
    opening_m: float = 0.0
    part: str = ""
    T_world_part: tuple[float, ...] = ()


@dataclass(frozen=True)
class Entry:
    """One option that was tried.

    `reason` says in a few words why it fell, and is None while nothing speaks against it. `value` is the number that
    was measured and `limit` the number it was held against, both in `unit`, which is SI (m, m², rad, s) or a share, a count or
    nothing (`""`); people read it through `measured`. `bodies` names what collided, if anything, and `posture` where.
    """

    id: int
    parent: int | None
    stage: str
    option: str
    reason: str | None = None
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    bodies: tuple[str, ...] = ()
    posture: Posture | None = None


class Ledger:
    """Collects the entries of one search. It lives as long as the search does; results carry `entries`."""

    def __init__(self) -> None:
        self._entries: list[Entry] = []

    @property
    def entries(self) -> tuple[Entry, ...]:
        return tuple(self._entries)

    def add(
        self,
        stage: str,
        option: str,
        reason: str | None = None,
        *,
        parent: int | None = None,
        value: float | None = None,
        limit: float | None = None,
        unit: str = "",
        bodies: tuple[str, ...] = (),
        posture: Posture | None = None,
    ) -> int:
        """Write an entry; its id."""
        self._entries.append(Entry(len(self._entries), parent, stage, option, reason, value, limit, unit, bodies, posture))
        return self._entries[-1].id

    def fall(
        self,
        entry: int,
        reason: str,
        *,
        value: float | None = None,
        limit: float | None = None,
        unit: str = "",
        bodies: tuple[str, ...] = (),
        posture: Posture | None = None,
    ) -> None:
        """The option of `entry`, open until now, fell for `reason`."""
        self._entries[entry] = replace(
            self._entries[entry], reason=reason, value=value, limit=limit, unit=unit, bodies=bodies, posture=posture
        )

    def adopt(self, entries: Iterable[Entry], parent: int | None = None) -> None:
        """Take over the entries of a stage that was called, below `parent`."""
        offset = len(self._entries)
        for entry in entries:
            above = parent if entry.parent is None else entry.parent + offset
            self._entries.append(replace(entry, id=entry.id + offset, parent=above))


def rejected_counts(entries: Iterable[Entry]) -> dict[str, int]:
    """How many options fell for each reason, most frequent first."""
    return dict(Counter(entry.reason for entry in entries if entry.reason is not None).most_common())


SHOWN = {"m": (1e3, "mm", 2), "m²": (1e6, "mm²", 0), "rad": (180.0 / math.pi, "°", 1)}


def measured(value: float, unit: str) -> str:
    """A number as people read it: lengths in mm, areas in mm², angles in degrees, without digits that mean nothing."""
    factor, shown, digits = SHOWN.get(unit, (1.0, unit, 3))
    return f"{round(value * factor, digits) + 0.0:.10g} {shown}".rstrip()


def describe(entry: Entry) -> str:
    """An entry's reason with its bodies, its number and the limit, as it is read on screen; empty while nothing speaks against it."""
    text = entry.reason or ""
    if text and entry.bodies:
        text += f" ({' and '.join(entry.bodies)})"
    if text and entry.value is not None:
        text += f": {measured(entry.value, entry.unit)}"
        text += "" if entry.limit is None else f", limit {measured(entry.limit, entry.unit)}"
    return text


def entry_report(entry: Entry) -> dict[str, Any]:
    """An entry as JSON values: a number that is not finite is null."""
    return asdict(entry) | {key: finite(getattr(entry, key)) for key in ("value", "limit")}


def finite(value: float | None) -> float | None:
    """A number as JSON has it; null when it is not finite."""
    return float(value) if value is not None and math.isfinite(value) else None
