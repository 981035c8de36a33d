"""Explanations worked out beside the loop, so that the page stays live; the first look at a scan takes a moment."""

import logging
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from handey_studio.app.state import Explained, State
from handey_studio.localization.explain import Explanation
from handey_studio.session.looking import explained
from handey_studio.task.sense import Scene

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Explain:
    """Hypothesis `number` of a scene was explained."""

    said: Explained

    def apply(self, state: State) -> State:
        return replace(state, explained=self.said)


class Explainer:
    """Explains one hypothesis after the other; one that was asked for and is no longer looked at is left out."""

    def __init__(self, send: Callable[[Any], None]) -> None:
        self._send = send
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="explainer")
        self._asked: Future[Explanation | None] | None = None
        self._for: tuple[Scene, int] | None = None

    def follow(self, state: State) -> None:
        """Ask for what the state looks at, unless it was asked for already."""
        scene, number = state.session.scene, state.session.view.hypothesis
        if scene is None or state.hypothesis is None or (self._for is not None and self._for[0] is scene and self._for[1] == number):
            return
        if self._asked is not None:
            self._asked.cancel()
        self._for = (scene, number)
        self._asked = self._thread.submit(explained, scene, state.session.parts, number)
        self._asked.add_done_callback(partial(self._done, scene, number))

    def stop(self) -> None:
        """End the thread after what it is at."""
        self._thread.shutdown(wait=False, cancel_futures=True)

    def _done(self, scene: Scene, number: int, asked: "Future[Explanation | None]") -> None:
        if asked.cancelled():
            return
        error = asked.exception()
        if error is not None:
            log.error("hypothesis %d could not be explained", number, exc_info=error)
        self._send(Explain(Explained(scene, number, None if error else asked.result())))
