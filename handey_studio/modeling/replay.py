"""A model's history, run: each step changes the state or falls with its one sentence, and the steps after it go on without it.

Replaying is exact and repeatable. A step is a pure function of the state before it, and is remembered: running a draft again after its
last step has changed costs that step alone.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.modeling.applying import applied
from handey_studio.modeling.draft import Draft
from handey_studio.modeling.operations import Operation
from handey_studio.modeling.state import State

REMEMBERED = 1024


@dataclass(frozen=True)
class Step:
    """How one operation went: `told` in a few words what it was; `reason` is None when it was done, else the sentence why it fell."""

    number: int
    kind: str
    told: str
    reason: str | None


@dataclass(frozen=True, eq=False)
class Built(State):
    """What a draft's history makes: the `State` at its end and how each step went."""

    steps: tuple[Step, ...] = ()


def replay(draft: Draft) -> Built:
    """The model that a draft's operations make, in the model's frame (the first scan's world)."""
    return replayed(start(draft), draft.operations)


def start(draft: Draft) -> State:
    """The state before the first step: scans, of which the first one's pose is known, and nothing else."""
    return State(scans=tuple(scan.name for scan in draft.scans), poses=_first_pose(draft))


def replayed(state: State, operations: tuple[Operation, ...]) -> Built:
    """The operations run from a state on."""
    steps = []
    for number, operation in enumerate(operations):
        state, reason = outcome(state, operation)
        steps.append(Step(number, operation.kind, operation.told, reason))
    return Built(**state.fields, steps=tuple(steps))


@lru_cache(maxsize=REMEMBERED)
def outcome(state: State, operation: Operation) -> tuple[State, str | None]:
    """The state after an operation and None, or the state as it was and why the operation fell."""
    try:
        return applied(operation, state).after_step(), None
    except BadInput as error:
        return state.after_step(), str(error)


def _first_pose(draft: Draft) -> tuple[tuple[str, NDArray], ...]:
    return ((draft.scans[0].name, np.eye(4)),) if draft.scans else ()
