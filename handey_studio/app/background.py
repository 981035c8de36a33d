"""What takes longer than a frame is worked out in a thread of its own, so that the loop goes on."""

import logging
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import Any

from handey_studio.app.state import State, same

log = logging.getLogger(__name__)


class Background:
    """Works out one thing after the other; one that was asked for and is no longer wanted is left out.

    `wanted` says what a state wants worked out, as the arguments of `work`, None for nothing; `told` makes the command that is sent from
    these and the outcome, which is None when it failed. Arguments are compared by identity or, numbers and words, by value.
    """

    def __init__(
        self,
        send: Callable[[Any], None],
        wanted: Callable[[State], tuple | None],
        work: Callable[..., Any],
        told: Callable[[tuple, Any], Any],
    ) -> None:
        self._send, self._wanted, self._work, self._told = send, wanted, work, told
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="background")
        self._asked: Future[Any] | None = None
        self._for: tuple | None = None

    def follow(self, state: State) -> None:
        """Ask for what the state wants, unless it was asked for already."""
        wanted = self._wanted(state)
        if wanted is None or same(wanted, self._for):
            return
        if self._asked is not None:
            self._asked.cancel()
        self._for = wanted
        self._asked = self._thread.submit(self._work, *wanted)
        self._asked.add_done_callback(partial(self._done, wanted))

    def stop(self) -> None:
        """End the thread after what it is at."""
        self._thread.shutdown(wait=False, cancel_futures=True)

    def _done(self, wanted: tuple, asked: "Future[Any]") -> None:
        if asked.cancelled():
            return
        error = asked.exception()
        if error is not None:
            log.error("%s failed", self._work.__name__, exc_info=error)
        self._send(self._told(wanted, None if error else asked.result()))
