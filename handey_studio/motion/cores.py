"""Compiled work shared by the processor's cores."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray


def share(work: Callable[[NDArray], None], count: int) -> None:
    """Calls work(mine) in a thread a core, `mine` (k,) being its share of the numbers 0 to count - 1; it must let go of Python's lock."""
    workers = max(1, min(_cores(), count))
    others = [_pool().submit(work, np.arange(worker, count, workers)) for worker in range(1, workers)]
    work(np.arange(0, count, workers))
    for done in others:
        done.result()


@lru_cache(maxsize=1)
def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    """The threads for the other cores, kept: to start them takes longer than some of the work."""
    return ThreadPoolExecutor(max(1, _cores() - 1), "core")
