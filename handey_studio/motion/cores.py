"""Compiled work shared by the processor's cores."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray


def share(work: Callable[[NDArray], None], count: int) -> None:
    """Calls work(mine) in a thread a core, `mine` (k,) being its share of the numbers 0 to count - 1; it must let go of Python's lock."""
    workers = max(1, min(os.cpu_count() or 1, count))
    with ThreadPoolExecutor(workers) as pool:
        for done in [pool.submit(work, np.arange(worker, count, workers)) for worker in range(workers)]:
            done.result()
