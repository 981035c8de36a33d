"""Planners that misbehave on purpose. They run in the planner's own process, so they are plain functions of a module."""

import os
import time
from dataclasses import replace

from handey_studio.base import BadInput
from handey_studio.session import Session
from handey_studio.task.plan import MoveResult
from handey_studio.world import Library


def patient(session: Session, library: Library, execute: bool, progress) -> Session:
    """Works until it is cancelled, for a minute at most."""
    for count in range(600):
        progress.report(count / 600, f"grasp group {count} of 600")
        if progress.cancelled:
            return replace(session, results=(MoveResult(session.commands[-1], "failed", "cancelled"),))
        time.sleep(0.1)
    return session


def dying(session: Session, library: Library, execute: bool, progress) -> Session:
    """Its process ends in the middle of a plan; executing gets through."""
    if execute:
        return replace(session, results=(MoveResult(session.commands[-1], "failed", "survived"),))
    progress.report(0.5, "about to break down")
    os._exit(7)


def refusing(session: Session, library: Library, execute: bool, progress) -> Session:
    """Cannot start on this."""
    raise BadInput('the part "<b>l_block</b>" is not to my taste.')
