"""What a user can ask for that reaches beyond the state: an action's `run` is given the workbench, and returns the next state. Raises
BadInput with one sentence."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

from numpy.typing import NDArray

from handey_studio.app.jobs import JobStarted, check_idle
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.session import Session
from handey_studio.task.plan import MoveCommand


class Bench(Protocol):
    """What an action may use of the workbench."""

    state: State
    planner: Any

    def client(self, number: int | None) -> Any: ...
    def recorded(self, states: Sequence[State], period_s: float) -> str: ...
    def look(self, position: NDArray, look_at: NDArray, client: int | None) -> None: ...


@dataclass(frozen=True)
class StartMove:
    """Sense and plan; with `execute` the cell carries it out."""

    execute: bool

    def run(self, bench: Bench) -> State:
        state = bench.state
        check_idle(state)
        command = state.command
        if command is None:
            raise BadInput("choose a part to move first.")
        state = JobStarted(self.execute).apply(state)
        bench.planner.order(state.jobs, alone(state.session, command), state.library, self.execute)
        return state


@dataclass(frozen=True)
class CancelMove:
    def run(self, bench: Bench) -> State:
        if bench.state.job is None:
            return bench.state
        bench.planner.cancel()
        return replace(bench.state, job=replace(bench.state.job, cancelling=True))


def alone(session: Session, command: MoveCommand) -> Session:
    """The session as if this were its only command, with the plan that was made for it if that is what is looked at."""
    last = session.results[-1:]
    planned = last if last and last[0].status == "planned" and last[0].command == command else ()
    return replace(session, commands=(command,), states=(), results=planned)
