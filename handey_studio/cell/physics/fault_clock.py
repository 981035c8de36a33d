"""When the faults of a setup begin and end: calls are counted, time is the cell's own."""

from collections import Counter
from collections.abc import Iterator, Sequence

from handey_studio.cell.faults import Call, Fault


class FaultClock:
    """Counts the cell's calls and tells which faults are on. Not a value: it lives with the cell."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        self._faults = tuple(faults)
        self._calls: Counter[Call] = Counter()
        self._begins: dict[int, float] = {}
        self._on: set[int] = set()

    def called(self, call: Call, now: float) -> None:
        """A call begins at `now` [s]."""
        self._calls[call] += 1
        for number, fault in enumerate(self._faults):
            if fault.call == call and fault.count == self._calls[call]:
                self._begins[number] = now + fault.time_s

    def on(self, now: float) -> list[tuple[int, Fault]]:
        """Faults that are on, with their numbers."""
        return [(n, self._faults[n]) for n, begin in self._begins.items() if begin <= now <= begin + self._faults[n].lasts_s]

    def changes(self, now: float) -> Iterator[tuple[int, Fault, bool]]:
        """Faults that went on (True) or off since the last look."""
        if not self._begins:
            return
        on = {number for number, _ in self.on(now)}
        for number in on ^ self._on:
            yield number, self._faults[number], number in on
        self._on = on
