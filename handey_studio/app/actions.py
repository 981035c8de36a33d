"""What a user can ask for that reaches beyond the state: files, the planner, a single browser."""

import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from handey_studio.app.commands import Command, ShowLayer
from handey_studio.app.jobs import JobStarted
from handey_studio.app.scene.cspace import LAYER as CSPACE
from handey_studio.app.scene.cspace import MIDDLE_M
from handey_studio.app.state import State, opened
from handey_studio.base import BadInput
from handey_studio.geometry.transforms import apply
from handey_studio.localization import Hypothesis
from handey_studio.session import (
    Session,
    ViewState,
    check_name,
    find_session,
    own_file,
    read_session,
    session_from_bytes,
    session_to_bytes,
    write_session,
)
from handey_studio.task.plan import MoveCommand
from handey_studio.world.library import bundled

log = logging.getLogger(__name__)

MAX_UPLOAD_BYTES = 64_000_000
CLOSE_UP = 2.6  # diameters of a part from which one looks at it
NEAR_M = 0.03  # a camera that looks no farther past a hypothesis looks at it


class Bench(Protocol):
    """What an action may use of the workbench."""

    state: State
    planner: Any

    def client(self, number: int | None) -> Any: ...
    def look(self, position: NDArray, look_at: NDArray, client: int | None) -> None: ...


class Action(Protocol):
    """An action returns the next state. Raises BadInput with one sentence."""

    def run(self, bench: Bench) -> State: ...


@dataclass(frozen=True)
class NewSession:
    """The same workcell with nothing found yet."""

    name: str = "untitled"

    def run(self, bench: Bench) -> State:
        state, kept = put_away(bench.state)
        session = replace(state.session.without_findings(), name=check_name(self.name))
        return _shown(bench, opened(state.library, session, None, state), f"New session in the same workcell.{kept}")


@dataclass(frozen=True)
class OpenSession:
    """A session of the library by its name."""

    name: str

    def run(self, bench: Bench) -> State:
        if self.name not in bench.state.library.sessions():
            find_session(bench.state.library, self.name)
        path = bench.state.library.sessions()[self.name]
        session = read_session(path)
        state, kept = put_away(bench.state)
        return _shown(bench, opened(state.library, session, path, state), f'Opened "{session.name}".{kept}')


@dataclass(frozen=True, eq=False)
class UploadSession:
    """A session file from the user's own machine. It is not written anywhere until it is saved."""

    file_name: str
    content: bytes

    def run(self, bench: Bench) -> State:
        if len(self.content) > MAX_UPLOAD_BYTES:
            raise BadInput(f'"{self.file_name}" has {len(self.content)} bytes, the limit for a session is {MAX_UPLOAD_BYTES}.')
        session = session_from_bytes(self.content, self.file_name)
        state, kept = put_away(bench.state)
        return _shown(bench, opened(state.library, session, None, state), f'Opened "{session.name}" from the upload.{kept}')


@dataclass(frozen=True)
class SaveSession:
    """To its file; a bundled example goes to the user's own library under the same name."""

    def run(self, bench: Bench) -> State:
        path = bench.state.path
        if path is None or not _writable(path, bench.state):
            path = own_file(bench.state.library, bench.state.session.name)
        return _saved(bench.state, bench.state.session, path)


@dataclass(frozen=True)
class SaveSessionAs:
    """To the library under a new name."""

    name: str

    def run(self, bench: Bench) -> State:
        session = replace(bench.state.session, name=check_name(self.name.strip()))
        return _saved(bench.state, session, own_file(bench.state.library, session.name))


@dataclass(frozen=True)
class DownloadSession:
    client: int | None

    def run(self, bench: Bench) -> State:
        client = bench.client(self.client)
        if client is not None:
            session = bench.state.session
            client.send_file_download(f"{session.name}.handey", session_to_bytes(session), save_immediately=True)
        return bench.state


@dataclass(frozen=True)
class StartMove:
    """Sense and plan; with `execute` the cell carries it out."""

    execute: bool

    def run(self, bench: Bench) -> State:
        state = bench.state
        if state.job is not None:
            raise BadInput("the planner is at work; cancel first or wait for it.")
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


@dataclass(frozen=True)
class LookFrom:
    """One browser's camera goes to a named place."""

    view: str
    client: int | None

    def run(self, bench: Bench) -> State:
        position, look_at = viewpoint(self.view, bench.state)
        bench.look(position, look_at, self.client)
        return ShowLayer(CSPACE, True).apply(bench.state) if self.view == "C-space" else bench.state


@dataclass(frozen=True)
class Follow:
    """Look at another hypothesis; a camera that is close to the one before goes along."""

    command: Command
    client: int | None

    def run(self, bench: Bench) -> State:
        before, after = bench.state, self.command.apply(bench.state)
        if before.hypothesis is None or after.hypothesis is None:
            return after
        here, there = middle_of(before, before.hypothesis), middle_of(after, after.hypothesis)
        view = before.session.view
        if np.linalg.norm(view.camera_look_at - here) < NEAR_M and np.linalg.norm(there - here) > 0.0:
            bench.look(view.camera_position + there - here, view.camera_look_at + there - here, self.client)
        return after


def alone(session: Session, command: MoveCommand) -> Session:
    """The session as if this were its only command, with the plan that was made for it if that is what is looked at."""
    last = session.results[-1:]
    planned = last if last and last[0].status == "planned" and last[0].command == command else ()
    return replace(session, commands=(command,), states=(), results=planned)


def middle_of(state: State, hypothesis: Hypothesis) -> NDArray:
    """Where the part of a hypothesis has its middle (3,) [m]."""
    part = state.session.part(hypothesis.part)
    return apply(hypothesis.T_world_part, part.solid.vertices.mean(axis=0) if part is not None else np.zeros(3))


def viewpoint(view: str, state: State) -> tuple[NDArray, NDArray]:
    """Camera position and point to look at (3,) [m] of a named view."""
    finder, replay = state.session.workcell.finder, state.replay
    middle = finder.T_world_range[:3, 3] + finder.T_world_range[:3, :3] @ (finder.area[0] / 2, finder.area[1] / 2, 0.0)
    if view == "Top":
        return _seen_from(middle, (-0.001, 0.0, 0.85))
    if view == "Grasp" and replay is not None:
        return _seen_from(replay.plan.T_world_part_start[:3, 3], (0.22, -0.26, 0.20))
    if view == "Hand" and replay is not None:
        return _seen_from(replay.at(state.session.view.time_s).T_world_part[:3, 3], (0.30, -0.34, 0.26))
    if view == "C-space" and replay is not None and replay.plan.carries[0].space is not None:
        return _seen_from(MIDDLE_M, (1.3, -1.85, 0.95))
    if view == "Hypothesis" and state.hypothesis is not None:
        return _close_to(state, state.hypothesis)
    if view == "Workcell":
        return ViewState().camera_position, ViewState().camera_look_at
    return _seen_from(middle, (0.42, -0.46, 0.40))


def _close_to(state: State, hypothesis: Hypothesis) -> tuple[NDArray, NDArray]:
    """The whole part fills the middle of the view, from above and the front."""
    part = state.session.part(hypothesis.part)
    away = CLOSE_UP * (part.solid.diameter if part is not None else 0.1)
    return _seen_from(middle_of(state, hypothesis), (0.36 * away, -0.58 * away, 0.73 * away))


def _seen_from(point: NDArray, offset: tuple[float, float, float]) -> tuple[NDArray, NDArray]:
    return point + np.array(offset), point


def _saved(state: State, session: Session, path: Path) -> State:
    write_session(path, session)
    return replace(state, session=session, saved=session, path=path).told(f'Saved "{session.name}" to {path}.', "good")


def _writable(path: Path, state: State) -> bool:
    """Bundled sessions are read-only, unless the bundle is the user's own library."""
    return not path.is_relative_to(bundled()) or path.is_relative_to(state.library.folder)


def worth_keeping(state: State) -> bool:
    """Whether what is not saved is more than a session that was only opened."""
    return state.unsaved and (state.saved is not None or state.taken_up or bool(state.session.results) or bool(state.undo))


def put_away(state: State) -> tuple[State, str]:
    """Before another session comes: what was not saved goes to the library, and the planner may not be at work."""
    if state.job is not None:
        raise BadInput("the planner is at work; cancel first or wait for it.")
    if not worth_keeping(state):
        return state, ""
    path = own_file(state.library, f"{state.session.name} (unsaved)"[:120])
    write_session(path, replace(state.session, name=path.stem))
    return state, f' What was not saved is kept as "{path.stem}".'


def _shown(bench: Bench, state: State, sentence: str) -> State:
    bench.look(state.session.view.camera_position, state.session.view.camera_look_at, None)
    return state.told(sentence)
