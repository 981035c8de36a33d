"""Straight pieces of linked edge pixels, each fitted as one line in space."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base.compiled import put
from handey_studio.localization.creases import crease
from handey_studio.localization.edges import JUMP
from handey_studio.localization.flanks import Seen, w_of
from handey_studio.localization.lines import Line
from handey_studio.localization.runs import MIN_PIXELS, axis_of
from handey_studio.localization.shares import shared
from handey_studio.localization.silhouettes import silhouette
from handey_studio.localization.surface import reading_sigma

MAX_BENDS = 4  # rounds of cutting a segment in two
LEAST_PIECES = 10  # that are worth a share
SMOOTH = 3  # readings on either side that a reading's median is taken over


def straight_lines(
    seen: Seen, outward: NDArray, kind: NDArray, u: NDArray, v: NDArray, segment: NDArray
) -> tuple[tuple[Line, ...], NDArray]:
    """The lines of linked pixels (n,), and the number of each pixel's line (n,), −1 for none."""
    order = np.argsort(segment, kind="stable")
    order = order[segment[order] >= 0]
    numbers = np.full(len(segment), -1)
    if not len(order):
        return (), numbers
    start = np.r_[np.nonzero(np.diff(segment[order], prepend=-1))[0], len(order)]
    start = unbent(seen, u, v, order, start)
    lines = _in_shares(seen, outward, kind, u, v, order, start)
    kept = [k for k, line in enumerate(lines) if line.pixels]
    for number, k in enumerate(kept):
        numbers[order[start[k] : start[k + 1]]] = number
    return tuple(lines[k] for k in kept), numbers


def _in_shares(seen: Seen, outward: NDArray, kind: NDArray, u: NDArray, v: NDArray, order: NDArray, start: NDArray) -> list[Line]:
    """The line of each piece, some at a time on each core."""
    found: dict[int, list[Line]] = {}

    def work(first: int, last: int) -> None:
        found[first] = fitted(seen, outward, kind, u, v, order, start[first : last + 1])

    shared(work, len(start) - 1, LEAST_PIECES)
    return [line for first in sorted(found) for line in found[first]]


@njit(cache=True)
def _smoothed(values: NDArray) -> NDArray:
    """Medians over a few neighbours."""
    out = np.empty(len(values))
    for i in range(len(values)):
        out[i] = np.median(values[max(i - SMOOTH, 0) : i + SMOOTH + 1])
    return out


@njit(cache=True)
def _bend(seen: Seen, u: NDArray, v: NDArray, members: NDArray) -> int:
    """Where members, which it sorts along their line, bend in depth: how many lie before, 0 if nowhere."""
    x, y = u[members].astype(np.float64), v[members].astype(np.float64)
    _, _, du, dv, _ = axis_of(x, y, np.ones(len(x), dtype=np.bool_))
    along = x * du + y * dv
    order = np.argsort(along, kind="mergesort")
    put(members[order], members)
    along = along[order]
    n = len(members)
    if n < 2 * MIN_PIXELS:
        return 0
    w = np.empty(n)
    for i in range(n):
        w[i] = w_of(seen.depth[v[members[i]], u[members[i]]], seen.camera)
    w = _smoothed(w)
    ends = max(3, n // 8)
    a, b = along[:ends].mean(), along[n - ends :].mean()
    low, high = w[:ends].mean(), w[n - ends :].mean()
    off = np.abs(w - low - (along - a) * (high - low) / max(b - a, 1e-9))
    cut = int(np.argmax(off))
    d = w_of(w[cut], seen.camera)
    metres = off[cut] if seen.camera[0] > 0.5 else off[cut] * d * d
    bent = metres >= 4.0 * reading_sigma(d, seen.camera, seen.noise) + 0.25 * seen.outline
    return cut if bent and MIN_PIXELS <= cut < n - MIN_PIXELS else 0


@njit(cache=True)
def unbent(seen: Seen, u: NDArray, v: NDArray, order: NDArray, start: NDArray) -> NDArray:
    """Segments, of which number k has the members order[start[k] : start[k + 1]], cut where they bend in depth though they are straight
    in the image: where two edges run on in one line. The new starts; `order` is sorted along each."""
    out = np.empty(len(start) * 2**MAX_BENDS, dtype=np.int64)
    n = 0
    stack = np.empty((2 * MAX_BENDS + 2, 3), dtype=np.int64)
    for k in range(len(start) - 1):
        stack[0, 0], stack[0, 1], stack[0, 2] = start[k], start[k + 1], 0
        waiting = 1
        while waiting > 0:
            waiting -= 1
            low, high, depth = stack[waiting, 0], stack[waiting, 1], stack[waiting, 2]
            cut = _bend(seen, u, v, order[low:high])
            if cut == 0 or depth == MAX_BENDS:
                out[n] = low
                n += 1
                continue
            stack[waiting, 0], stack[waiting, 1], stack[waiting, 2] = low + cut, high, depth + 1
            stack[waiting + 1, 0], stack[waiting + 1, 1], stack[waiting + 1, 2] = low, low + cut, depth + 1
            waiting += 2
    out[n] = start[-1]
    return out[: n + 1]


@njit(cache=True, nogil=True)
def fitted(seen: Seen, outward: NDArray, kind: NDArray, u: NDArray, v: NDArray, order: NDArray, start: NDArray) -> list[Line]:
    """The line of each piece."""
    lines = []
    for k in range(len(start) - 1):
        members = order[start[k] : start[k + 1]]
        x, y = u[members].astype(np.float64), v[members].astype(np.float64)
        lines.append(silhouette(seen, outward, x, y) if kind[members[0]] == JUMP else crease(seen, x, y))
    return lines
