"""Work shared among the machine's cores: compiled loops over rows or poses, which let go of the interpreter's lock."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
from numba import config

SHARES = 4  # the same on every machine, so that a share's first row, and with it the rounding, is the same too


def shared(work: Callable[[int, int], object], count: int, least: int = 1) -> None:
    """Calls `work(first, last)` for shares that make up range(count), of at least `least` each, on as many cores as numba is allowed."""
    shares = max(1, min(SHARES, count // least))
    bounds = [int(bound) for bound in np.linspace(0, count, shares + 1)]
    workers = min(vars(config)["NUMBA_NUM_THREADS"], shares)
    if workers > 1:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(work, bounds, bounds[1:]))
    else:
        for first, last in pairwise(bounds):
            work(first, last)
