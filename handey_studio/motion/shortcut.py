"""Shorter paths: corners cut where the cut is proved."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handey_studio.motion.certificate import Mover


def cut_corners(points: NDArray, movers: Sequence[Mover], common: Mover, rounds: int) -> tuple[NDArray, list[Mover]]:
    """The path (n, joints) with corners cut, and the mover that proves each of its segments.

    `movers[k]` speaks for segment k. A cut is proved by the mover that all the segments it replaces share, else by `common`, which
    allows nothing that one of them forbids. Each round tries, from each point, the farthest that is reached straight.
    """
    path, speaks = list(points), list(movers)
    for _ in range(rounds):
        before = len(path)
        start = 0
        while start < len(path) - 2:
            end, mover = _farthest(path, speaks, common, start)
            if end > start + 1:
                path[start + 1 : end] = []
                speaks[start:end] = [mover]
            start += 1
        if len(path) == before:
            break
        path, speaks = _halfway(path, speaks)
    return np.array(path), speaks


def _farthest(path: list[NDArray], speaks: list[Mover], common: Mover, start: int) -> tuple[int, Mover]:
    """The farthest point reached straight from `start`, looked for by halving the reach."""
    reach = len(path) - 1 - start
    while reach > 1:
        end = start + reach
        mover = speaks[start] if all(m is speaks[start] for m in speaks[start:end]) else common
        if mover.moves(path[start], path[end]):
            return end, mover
        reach = reach // 2 if reach > 3 else reach - 1
    return start + 1, speaks[start]


def _halfway(path: list[NDArray], speaks: list[Mover]) -> tuple[list[NDArray], list[Mover]]:
    """With a point more in the middle of each segment: the next round can cut corners that the last could not."""
    points, movers = [path[0]], []
    for a, b, mover in zip(path[:-1], path[1:], speaks, strict=True):
        points += [(a + b) / 2, b]
        movers += [mover, mover]
    return points, movers


def without_idle_points(points: NDArray, speaks: list[Mover]) -> tuple[NDArray, list[Mover]]:
    """Without points that lie on the straight line between their neighbours, or on one of them."""
    path, movers = [points[0]], []
    for k in range(1, len(points)):
        if np.abs(points[k] - path[-1]).max() < 1e-12:
            continue
        if movers and movers[-1] is speaks[k - 1] and _straight(path[-2], path[-1], points[k]):
            path[-1] = points[k]
            continue
        path.append(points[k])
        movers.append(speaks[k - 1])
    return np.array(path), movers


def _straight(a: NDArray, b: NDArray, c: NDArray) -> bool:
    t = float((b - a) @ (c - a) / ((c - a) @ (c - a) + 1e-300))
    return 0.0 < t < 1.0 and float(np.abs(a + t * (c - a) - b).max()) < 1e-9
