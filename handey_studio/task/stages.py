"""What is still to be paid for a plan, stage by stage: the measure by which the options of a MOVE are put in order.

The times and shares are medians over random piles. They are constants and not clocks, so that a seed gives the same answer everywhere.
"""

from typing import NamedTuple


class Stage(NamedTuple):
    """One test of an option: its name, what it costs [s] and the share of options that pass it."""

    name: str
    seconds: float
    passes: float


DETOUR, ROTATIONS, APPROACH, REACH, STRAIGHT, PATHS = range(6)
STAGES = (
    Stage("detour", 0.200, 0.9),
    Stage("legal rotations", 0.002, 0.4),
    Stage("approach", 0.030, 0.6),
    Stage("reach", 0.010, 0.7),
    Stage("straight motions", 0.080, 0.6),
    Stage("arm motion", 0.300, 0.8),
)


def left(stage: int) -> float:
    """What a plan should still cost [s] from an option that has come to a stage: each later test as often as it takes until one passes."""
    total, chance = 0.0, 1.0
    for test in reversed(STAGES[stage:]):
        chance *= test.passes
        total += test.seconds / chance
    return total
