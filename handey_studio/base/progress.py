"""Progress and cancel: the one call inside long loops."""

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
