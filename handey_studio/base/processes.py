"""Processes that work for this one."""

import signal
from multiprocessing.process import BaseProcess


def start_apart(process: BaseProcess) -> None:
    """Starts a process that Ctrl-C at the terminal does not reach, from its first import on: whoever started it ends it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        process.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
