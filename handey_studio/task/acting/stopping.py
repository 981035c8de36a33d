"""A word to stop reaches the cell in the middle of a motion, not only between two of them; so does whatever breaks off the program."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from handey_studio.base import Progress
from handey_studio.cell.protocol import Cell

LOOK_S = 0.02  # how often it is looked whether somebody cancelled


@contextmanager
def stopping(cell: Cell, progress: Progress) -> Iterator[None]:
    """Within it, the cell is told to stop as soon as `progress` is cancelled, and again until whoever moves it has noticed. It is told so
    too when what is done within is broken off by an exception, such as a key that interrupts the program."""
    over, finished = threading.Event(), False

    def watch() -> None:
        while not over.wait(LOOK_S):
            if progress.cancelled:
                cell.stop()

    watcher = threading.Thread(target=watch, name="stopping", daemon=True)
    watcher.start()
    try:
        yield
        finished = True
    finally:
        over.set()
        watcher.join()
        if not finished:
            cell.stop()
