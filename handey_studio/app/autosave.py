"""A working copy of what is not saved, some seconds after the last change, and the offer to take it up again at the next start.

Each running workbench writes a file of its own in the library's folder `autosave`, whole or not at all; no file of the user's is touched.
The copy goes when the session is saved or put away.
"""

import logging
import os
import threading
from dataclasses import dataclass, replace
from pathlib import Path

from handey_studio.app.actions import Bench
from handey_studio.app.session_actions import put_away, worth_keeping
from handey_studio.app.state import State, kept, opened
from handey_studio.base import BadInput
from handey_studio.session import Session, read_session, write_session
from handey_studio.world import Library

log = logging.getLogger(__name__)

AFTER_S = 3.0  # without another change
FOLDER = "autosave"


class Autosave:
    """Writes the copy in a thread of its own. Lives as long as the workbench."""

    def __init__(self, library: Library) -> None:
        self._path = own_copy(library)
        self._timer: threading.Timer | None = None
        self._waiting: Session | None = None
        self._seen: tuple | None = None
        self._lock = threading.Lock()

    def follow(self, state: State) -> None:
        """The state changed, or was only looked at."""
        wanted = worth_keeping(state)
        seen = (wanted, *kept(state.session))
        if seen == self._seen:
            return
        self._seen = seen
        if self._timer is not None:
            self._timer.cancel()
        with self._lock:
            self._waiting = state.session if wanted else None
        if wanted:
            self._timer = threading.Timer(AFTER_S, self._write)
            self._timer.daemon = True
            self._timer.start()
        else:
            self._path.unlink(missing_ok=True)

    def stop(self) -> None:
        """Write what still waits to be written."""
        if self._timer is not None:
            self._timer.cancel()
        self._write()

    def _write(self) -> None:
        with self._lock:
            session, self._waiting = self._waiting, None
            if session is None:
                return
            try:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                write_session(self._path, session)
            except (OSError, BadInput) as error:
                log.warning("the working copy could not be written: %s", error)


def own_copy(library: Library) -> Path:
    """Where this process keeps its working copy."""
    return library.folder / FOLDER / f"{os.getpid()}.handey"


def left_behind(library: Library) -> Path | None:
    """The newest working copy of a workbench that runs no more, None if there is none."""
    try:
        copies = [path for path in (library.folder / FOLDER).glob("*.handey") if not _running(path.stem)]
        return max(copies, key=lambda path: path.stat().st_mtime, default=None)
    except OSError:
        return None


@dataclass(frozen=True)
class TakeUp:
    """What was not saved when the workbench ended is opened again. It stays unsaved until it is saved."""

    def run(self, bench: Bench) -> State:
        state = bench.state
        path = state.left_behind
        if path is None:
            return state
        session = read_session(path)
        state, said = put_away(state)
        path.replace(own_copy(state.library))
        bench.look(session.view.camera_position, session.view.camera_look_at, None)
        taken = replace(opened(state.library, session, None, state), taken_up=True, left_behind=None)
        return taken.told(f'"{session.name}" is as it was; save it to keep it.{said}')


@dataclass(frozen=True)
class LetGo:
    """What was left behind is not wanted."""

    def apply(self, state: State) -> State:
        if state.left_behind is not None:
            state.left_behind.unlink(missing_ok=True)
        return replace(state, left_behind=None)


@dataclass(frozen=True)
class Offer:
    """Something was left behind."""

    path: Path

    def apply(self, state: State) -> State:
        return replace(state, left_behind=self.path)


def _running(number: str) -> bool:
    """Whether the process that wrote a copy, or another of its number, is there."""
    if not number.isdigit() or int(number) == os.getpid():
        return number.isdigit()
    try:
        os.kill(int(number), 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
