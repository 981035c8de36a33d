"""What a user can ask for, as values: commands make the next state and do nothing else. Those that reach beyond the state, to files, the
planner or a single browser, are actions."""

from dataclasses import dataclass, replace
from typing import Protocol

from handey_studio.app.modelling.clicks import click_taken_back
from handey_studio.app.state import State, redone, undone


class Command(Protocol):
    """A command that makes the next state and does nothing else. Raises BadInput with one sentence."""

    def apply(self, state: State) -> State: ...


@dataclass(frozen=True)
class Undo:
    """The last change is taken back; while a tool of the modeller waits for its next click, that tool's last click."""

    def apply(self, state: State) -> State:
        before = click_taken_back(state)
        return undone(state) if before is None else before


@dataclass(frozen=True)
class Redo:
    def apply(self, state: State) -> State:
        return redone(state)


@dataclass(frozen=True)
class Viewers:
    """A browser came or went."""

    by: int

    def apply(self, state: State) -> State:
        return replace(state, viewers=max(0, state.viewers + self.by))


@dataclass(frozen=True)
class Tell:
    text: str
    kind: str = "info"
    client: int | None = None

    def apply(self, state: State) -> State:
        return state.told(self.text, self.kind, self.client)
