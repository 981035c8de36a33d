"""Sessions and their files: new, open, upload, save, download; what was not saved is put away first."""

from dataclasses import dataclass, replace
from pathlib import Path

from handey_studio.app.actions import Bench
from handey_studio.app.jobs import check_idle
from handey_studio.app.state import State, opened
from handey_studio.base import BadInput
from handey_studio.session import (
    Session,
    check_name,
    find_session,
    own_file,
    read_session,
    session_from_bytes,
    session_to_bytes,
    write_session,
)
from handey_studio.world.library import bundled

MAX_UPLOAD_BYTES = 64_000_000


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
    check_idle(state)
    if not worth_keeping(state):
        return state, ""
    path = own_file(state.library, f"{state.session.name} (unsaved)"[:120])
    write_session(path, replace(state.session, name=path.stem))
    return state, f' What was not saved is kept as "{path.stem}".'


def _shown(bench: Bench, state: State, sentence: str) -> State:
    bench.look(state.session.view.camera_position, state.session.view.camera_look_at, None)
    return state.told(sentence)
