"""The planner in a process of its own, so that the page stays live while a core computes.

The process is started once and kept warm. Messages are plain values over a pipe; cancel is an event that the planner's
progress looks at. When the process breaks down, that is told in a sentence and the next job gets a new one.
"""

import logging
import multiprocessing as mp
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Any

from handey_studio.base import BadInput
from handey_studio.base.processes import start_apart
from handey_studio.session import Session
from handey_studio.world import Library

log = logging.getLogger(__name__)

Run = Callable[..., Any]
"""run(session, library, execute, progress) -> Session, with `progress.show(session)` to show what was found so far. A job that says itself
what becomes of what comes back may return something else."""


@dataclass(frozen=True)
class Progressed:
    number: int
    fraction: float
    message: str


@dataclass(frozen=True, eq=False)
class Shown:
    """Something to look at before the job is done."""

    number: int
    session: Session


@dataclass(frozen=True, eq=False)
class Finished:
    number: int
    found: Any


@dataclass(frozen=True)
class Failed:
    """`sentence` is for the user. `broken`: the process itself is gone."""

    number: int
    sentence: str
    broken: bool = False


@dataclass(frozen=True, eq=False)
class _Order:
    number: int
    session: Session
    library: Library
    execute: bool
    run: Run | None


class PipeProgress:
    """What the planner reports to, on the planner's side of the pipe."""

    def __init__(self, number: int, pipe: Connection, cancel: Any) -> None:
        self._number, self._pipe, self._cancel = number, pipe, cancel

    def report(self, fraction: float, message: str) -> None:
        self._pipe.send(Progressed(self._number, float(fraction), message))

    def show(self, session: Session) -> None:
        """Show a session with what was found so far."""
        self._pipe.send(Shown(self._number, session))

    @property
    def cancelled(self) -> bool:
        return self._cancel.is_set()


class Planner:
    """One planner process. `heard` is called from a thread of its own with each message that comes back.

    `prepare` runs in the process before its first job, so that what is compiled on first use is compiled while the user looks.
    """

    def __init__(self, run: Run, heard: Callable[[Any], None], prepare: Callable[[], None] | None = None) -> None:
        self._run, self._heard, self._prepare = run, heard, prepare
        self._context = mp.get_context("spawn")
        self._lock = threading.Lock()
        self._number = 0
        self._stopping = False
        self._start()

    def _start(self) -> None:
        self._pipe, theirs = self._context.Pipe()
        self._cancel = self._context.Event()
        given = (theirs, self._cancel, self._run, self._prepare)
        self._process = self._context.Process(target=_serve, args=given, name="handey-planner", daemon=True)
        start_apart(self._process)
        theirs.close()
        threading.Thread(target=self._listen, args=(self._pipe, self._process), name="planner-listener", daemon=True).start()

    def order(self, number: int, session: Session, library: Library, execute: bool, run: Run | None = None) -> None:
        """Start a job, with another function than the planner's own if one is given; whatever it has to say is heard later."""
        with self._lock:
            if not self._process.is_alive():
                self._start()
            self._number = number
            self._cancel.clear()
            try:
                self._pipe.send(_Order(number, replace(session, draft=None), library, execute, run))
            except (BrokenPipeError, OSError):
                self._heard(Failed(number, "The planner could not be reached; press again to start a new one.", True))

    def cancel(self) -> None:
        """Ask the job to end early; it comes back finished, with its record so far."""
        self._cancel.set()

    @property
    def pid(self) -> int | None:
        """The process's id."""
        return self._process.pid

    def stop(self) -> None:
        """End the process."""
        self._stopping = True
        self._cancel.set()
        self._process.terminate()
        self._process.join(timeout=5)

    def _listen(self, pipe: Connection, process: Any) -> None:
        while True:
            try:
                self._heard(pipe.recv())
            except (EOFError, OSError):
                break
        process.join(timeout=5)
        if not self._stopping:
            log.error("the planner process ended with status %s", process.exitcode)
            sentence = f"The planner broke down (exit status {process.exitcode}); nothing was lost, press again to start a new one."
            self._heard(Failed(self._number, sentence, True))


def _serve(pipe: Connection, cancel: Any, run: Run, prepare: Callable[[], None] | None) -> None:
    """The planner process: one job after the other until the pipe closes."""
    if prepare is not None:
        prepare()
    while True:
        try:
            order = pipe.recv()
        except EOFError:
            return
        progress = PipeProgress(order.number, pipe, cancel)
        try:
            pipe.send(Finished(order.number, (order.run or run)(order.session, order.library, order.execute, progress)))
        except BadInput as error:
            pipe.send(Failed(order.number, str(error)))
