"""The workbench: one loop owns the state; everything else sends commands and draws what it is given."""

import logging
import queue
import threading
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app.autosave import Autosave
from handey_studio.app.commands import Tell, Viewers
from handey_studio.app.explaining import Explainer
from handey_studio.app.handling import Handler
from handey_studio.app.jobs import JobDone, JobFailed, JobProgress, JobShows
from handey_studio.app.looking_at import CameraMoved
from handey_studio.app.modelling.showing import turn_to_model
from handey_studio.app.modelling.workers import modelling_workers
from handey_studio.app.palette import BLUE, TEAL, VERMILLION
from handey_studio.app.planner import Failed, Finished, Planner, Progressed, Run, Shown
from handey_studio.app.playback import Tick
from handey_studio.app.scene.units import SCALE, metres
from handey_studio.app.state import State, opened
from handey_studio.app.tabs import front_tabs, tabs_with_news
from handey_studio.app.view import View
from handey_studio.app.wire import show_tabs, tame_keys
from handey_studio.base import BadInput
from handey_studio.session import Session
from handey_studio.world import Library

log = logging.getLogger(__name__)

FRAME_S = 1.0 / 30.0
IDLE_S = 0.25
NOTICE_S = 7.0
RELOAD = "Save the session and start the program anew if it stays so; its log tells more."
FIELD_OF_VIEW_RAD = float(np.deg2rad(40.0))
NOTICE_LOOKS = {
    "info": ("Handey Studio", BLUE),
    "planned": ("Planned", TEAL),
    "good": ("Done", TEAL),
    "bad": ("That did not work", VERMILLION),
}


class Workbench:
    """Server, planner and state of one running workbench. `start` returns at once; `stop` ends it."""

    def __init__(
        self, server: viser.ViserServer, library: Library, session: Session, path: Path | None, run: Run, prepare: Callable[[], None] | None
    ) -> None:
        self.server = server
        self.state: State = opened(library, session, path)
        self._commands: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._camera: CameraMoved | None = None
        self._before = session.view
        self._running = threading.Event()
        self._running.set()
        self.planner = Planner(run, lambda message: self.send(heard(message)), prepare)
        self._autosave = Autosave(library)
        self._background = (Explainer(self.send), Handler(self.send), *modelling_workers(self.send))
        self._view = View(server, self.send)
        self._start_from(session.view.camera_position, session.view.camera_look_at)
        self._view.render(None, self.state)
        self._follow()
        server.on_client_connect(self._arrived)
        server.on_client_disconnect(lambda _: self.send(Viewers(-1)))
        self._thread = threading.Thread(target=self._loop, name="workbench", daemon=True)

    def start(self) -> None:
        """Begin to answer."""
        self._thread.start()

    def stop(self) -> None:
        """End the loop, the planner and the server."""
        self._running.clear()
        self._commands.put(None)
        self._thread.join(timeout=10)
        for worker in self._background:
            worker.stop()
        self._autosave.stop()
        self.planner.stop()
        self.server.stop()

    def send(self, command: Any) -> None:
        """Put a command into the queue; any thread may."""
        self._commands.put(command)

    def client(self, number: int | None) -> viser.ClientHandle | None:
        """A connected browser, None when it is gone."""
        return None if number is None else self.server.get_clients().get(number)

    def look(self, position: NDArray, look_at: NDArray, client: int | None) -> None:
        """Point one browser's camera, or everyone's."""
        if client is None:
            self._start_from(position, look_at)
        for number, handle in self.server.get_clients().items():
            if client in (None, number):
                with handle.atomic():
                    handle.camera.position = position * SCALE
                    handle.camera.look_at = look_at * SCALE

    def recorded(self, states: Sequence[State], period_s: float) -> str:
        """A page (HTML) that shows the scene of each state in turn, for so long [s]; browsers see none of it."""
        recording = self.server.get_scene_serializer()
        with self.server.atomic():
            for before, state in pairwise((self.state, *states)):
                self._view.draw_scene(before, state)
                recording.insert_sleep(period_s)
            page = recording.as_html(dark_mode=self.state.dark)
            self._view.draw_scene(states[-1], self.state)
        return page

    def _loop(self) -> None:
        last = time.monotonic()
        while self._running.is_set():
            self._take(self._wait(last))
            now = time.monotonic()
            if self.state.playing and now - last >= FRAME_S:
                self._take([Tick(now - last)])
            if now - last >= FRAME_S:
                last = now

    def _wait(self, last: float) -> list[Any]:
        """All commands that are there, waiting a little for the first."""
        wait = max(0.0, last + FRAME_S - time.monotonic()) if self.state.playing else IDLE_S
        waiting = []
        try:
            waiting.append(self._commands.get(timeout=wait))
            while True:
                waiting.append(self._commands.get_nowait())
        except queue.Empty:
            pass
        if self._camera is not None:
            waiting.append(self._camera)
            self._camera = None
        return [command for command in waiting if command is not None]

    def _take(self, commands: list[Any]) -> None:
        """Each command makes the next state; the screen then gets the difference."""
        if not commands:
            return
        old = self.state
        for command in commands:
            self.state = self._next(command)
        broken = self._view.render(old, self.state)
        if broken:
            self.state = self.state.told(f"{', '.join(broken)} could not be drawn; nothing is lost. {RELOAD}", "bad")
        self._turn(old)
        self._follow()
        self._notify(old)

    def _next(self, command: Any) -> State:
        try:
            return command.run(self) if hasattr(command, "run") else command.apply(self.state)
        except BadInput as error:
            return self.state.told(str(error), "bad")
        except Exception:
            log.exception("%s broke down", type(command).__name__)
            return self.state.told(f"{type(command).__name__} broke down and changed nothing. {RELOAD}", "bad")

    def _turn(self, old: State) -> None:
        """What is new comes to the front; when the model is opened or closed, the cameras go there or back."""
        new = self.state
        news = tabs_with_news(old, new)
        if news:
            for client in self.server.get_clients().values():
                show_tabs(client, *news)
        if old.modelling == new.modelling:
            return
        if new.modelling:
            self._before = old.session.view
            turn_to_model(self)
        else:
            self.look(self._before.camera_position, self._before.camera_look_at, None)

    def _follow(self) -> None:
        """What the state wants worked out is worked out in the background; what is not saved is kept."""
        self._autosave.follow(self.state)
        for worker in self._background:
            worker.follow(self.state)

    def _notify(self, old: State) -> None:
        known = old.notices[-1].number if old.notices else -1
        for notice in self.state.notices:
            if notice.number <= known:
                continue
            title, colour = NOTICE_LOOKS[notice.kind]
            for number, client in self.server.get_clients().items():
                if notice.client in (None, number):
                    client.add_notification(title, notice.text, color=colour, auto_close_seconds=NOTICE_S)

    def _arrived(self, client: viser.ClientHandle) -> None:
        self.send(Viewers(1))
        tame_keys(client)
        show_tabs(client, *front_tabs(self.state), remembered=True)

        def moved(camera: viser.CameraHandle) -> None:
            self._camera = CameraMoved(metres(camera.position), metres(camera.look_at))

        client.camera.on_update(moved)

    def _start_from(self, position: NDArray, look_at: NDArray) -> None:
        """Where the cameras of browsers yet to come begin."""
        camera = self.server.initial_camera
        camera.position = tuple(position * SCALE)
        camera.look_at = tuple(look_at * SCALE)
        camera.fov = FIELD_OF_VIEW_RAD


def heard(message: Any) -> Any:
    """The command that a message from the planner means."""
    match message:
        case Progressed(number, fraction, text):
            return JobProgress(number, fraction, text)
        case Shown(number, session):
            return JobShows(number, session)
        case Finished(number, found):
            return JobDone(number, found)
        case Failed(number, sentence):
            return JobFailed(number, sentence)
    return Tell(f"The planner said something unknown: {type(message).__name__}.", "bad")
