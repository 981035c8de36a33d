"""The seeds of a benchmark shared out among processes."""

import multiprocessing as mp
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

T = TypeVar("T")


def shared_out(work: Callable[[int], T], seeds: Iterable[int], jobs: int) -> Iterator[T]:
    """What `work` makes of each seed, in the seeds' order, in so many processes; with one it is done here.

    With several, `work` and what it gives must pickle: a function of a module, or a `partial` of one.
    """
    if jobs == 1:
        yield from map(work, seeds)
        return
    with ProcessPoolExecutor(jobs, mp_context=mp.get_context("spawn")) as pool:
        yield from pool.map(work, seeds)
