"""Progress and cancel: the one call inside long loops."""

from dataclasses import dataclass
from typing import Protocol


class Progress(Protocol):
    """What a long search reports to. A search that sees `cancelled` ends early and returns its record so far."""

    def report(self, fraction: float, message: str) -> None:
        """`fraction` of the work is done, in [0, 1]; `message` says what is being tried, with counts."""
        ...

    @property
    def cancelled(self) -> bool: ...


class Silent:
    """Progress that nobody watches and nobody cancels."""

    cancelled = False

    def report(self, fraction: float, message: str) -> None:
        pass


@dataclass(frozen=True)
class Share:
    """A share of a longer piece of work, as the progress of its own."""

    whole: Progress
    low: float
    high: float

    def report(self, fraction: float, message: str) -> None:
        self.whole.report(self.low + fraction * (self.high - self.low), message)

    @property
    def cancelled(self) -> bool:
        return self.whole.cancelled
