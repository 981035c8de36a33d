"""The first run on a machine compiles for minutes; a process beside the one that works takes a share of it.

Compiled code is kept on the disk, so each of the two loads what the other has compiled.
"""

import multiprocessing as mp
import os
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from handey_studio.base import BadInput, Silent
from handey_studio.base.compiled import is_compiled
from handey_studio.base.processes import start_apart
from handey_studio.localization.creases import crease
from handey_studio.motion.marching import march
from handey_studio.session.run import run_session
from handey_studio.session.session import Session
from handey_studio.world import Library

NICE = 5  # beside a page that someone looks at


class _Unseen(Silent):
    def show(self, session: Session) -> None:
        pass


def compile_beside(work: Callable[..., Any], *given: Any) -> bool:
    """Starts a process that does `work(*given)` for what it compiles, and ends with this one; False where nothing is left to compile."""
    if is_compiled(crease) and is_compiled(march):
        return False
    start_apart(mp.get_context("spawn").Process(target=_quietly, args=(work, given), name="handey-compiling", daemon=True))
    return True


def rehearse(session: Session, library: Library) -> None:
    """Plans the session's MOVE, if it has one, and forgets it."""
    if session.commands:
        run_session(session, library, False, _Unseen())


def _quietly(work: Callable[..., Any], given: tuple[Any, ...]) -> None:
    """What is wrong with the session is told by the process that works."""
    os.nice(NICE)
    with suppress(BadInput):
        work(*given)
