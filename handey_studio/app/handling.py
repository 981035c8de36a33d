"""Works out, away from the loop, what the hand can do with the part that is looked at."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from handey_studio.app.background import Background
from handey_studio.app.state import Handled, State
from handey_studio.session.handling import handling


@dataclass(frozen=True, eq=False)
class Handle:
    """It was worked out for these arguments."""

    said: Handled

    def apply(self, state: State) -> State:
        return replace(state, handled=self.said)


class Handler(Background):
    """One part, or one MOVE, after the other."""

    def __init__(self, send: Callable[[Any], None]) -> None:
        super().__init__(send, lambda state: state.to_handle, handling, lambda asked, said: Handle(Handled(asked, said)))
