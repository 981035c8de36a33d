"""What judging an answer says, whoever judges."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from numpy.typing import NDArray


@dataclass(frozen=True)
class Verdict:
    """On one reported pose: `right`, and `strict` by tighter limits; `matches` no true instance (a false find) or one of the judge's
    instances by number; errors where the truth is known; `measures` are the judge's own numbers."""

    right: bool
    strict: bool
    matches: int | None
    off_mm: float | None = None
    off_deg: float | None = None
    measures: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Instance:
    """A true instance of the part that was asked for. `visible_fraction` is None where nobody knows it."""

    visible_fraction: float | None
    visible_px: int


class Judge(Protocol):
    """Knows what is in a scene."""

    def instances(self, part: str) -> tuple[Instance, ...]:
        """The true instances of a part; none if it is absent."""
        ...

    def verdicts(self, part: str, Ts_sensor_part: Sequence[NDArray]) -> tuple[Verdict, ...]:
        """One verdict a reported pose, in order."""
        ...
