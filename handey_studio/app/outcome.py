"""What a MOVE came to, in numbers that outlive its result."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Outcome:
    """One MOVE that was to be carried out: whether the range finder was misplaced then, the attempts, what was noticed in them, how far off
    [m, rad] its command the scan afterwards saw the part (None where it did not), and how far off it truly was."""

    misplaced: bool
    what: str
    status: str
    reason: str
    attempts: int
    noticed: int
    seen_off: tuple[float, float] | None
    truly_off: tuple[float, float] | None
