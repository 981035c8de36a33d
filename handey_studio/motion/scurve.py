"""Speeds that rise and fall with an even jerk: how far that takes, and a way's place at each time (the seven phases of an s-curve)."""

from dataclasses import dataclass
from itertools import pairwise
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

HALVINGS = 50


class Pace(NamedTuple):
    """The most that a stretch may be run at: its speed, how hard that may rise or fall, and how suddenly."""

    speed: float
    acceleration: float
    jerk: float


@dataclass(frozen=True, eq=False)
class Run:
    """Phases of even jerk: when each begins, with the place, the speed and the acceleration there, and its jerk, all (k,)."""

    begins: NDArray
    states: NDArray
    seconds: float

    def at(self, time: NDArray) -> NDArray:
        """Places (n,) at times (n,) [s]."""
        k = np.searchsorted(self.begins, time, side="right") - 1
        place, speed, acceleration, jerk = self.states[k].T
        t = time - self.begins[k]
        return place + t * (speed + t * (acceleration / 2.0 + t * jerk / 6.0))


def run(lengths: NDArray, paces: list[Pace], stops: NDArray) -> Run:
    """Through stretches (n,) as fast as their paces allow, from rest to rest, and at rest where `stops` (n + 1,) say so.

    Where stretches meet the acceleration is none.
    """
    speeds = _passing(lengths, paces, stops)
    begins, states, time, place = [], [], 0.0, 0.0
    for length, pace, before, after in zip(lengths, paces, speeds[:-1], speeds[1:], strict=True):
        peak = _most(max(before, after), pace.speed, lambda top, p=pace, b=before, a=after: _way(b, top, p) + _way(top, a, p), length)
        cruise = max(0.0, length - _way(before, peak, pace) - _way(peak, after, pace)) / peak
        s, v, a = place, before, 0.0
        for seconds, jerk in (*_change(before, peak, pace), (cruise, 0.0), *_change(peak, after, pace)):
            if seconds <= 0.0:
                continue
            begins.append(time)
            states.append((s, v, a, jerk))
            s += seconds * (v + seconds * (a / 2.0 + seconds * jerk / 6.0))
            v, a, time = v + seconds * (a + seconds * jerk / 2.0), a + seconds * jerk, time + seconds
        place += length
    return Run(np.array(begins), np.array(states), time)


def _passing(lengths: NDArray, paces: list[Pace], stops: NDArray) -> list[float]:
    """Speeds (n + 1,) where stretches meet: none is more than can be reached from rest before and braked to rest behind it."""
    most = [0.0, *(min(a.speed, b.speed) for a, b in pairwise(paces)), 0.0]
    speeds = [0.0 if stop else speed for speed, stop in zip(most, stops, strict=True)]
    for k, (length, pace) in enumerate(zip(lengths, paces, strict=True)):
        speeds[k + 1] = _reached(speeds[k], speeds[k + 1], pace, length)
    for k in range(len(paces) - 1, -1, -1):
        speeds[k] = _reached(speeds[k + 1], speeds[k], paces[k], lengths[k])
    return speeds


def _reached(start: float, wanted: float, pace: Pace, length: float) -> float:
    """The speed up to `wanted` that is reached from another one within a length."""
    return wanted if wanted <= start else _most(start, wanted, lambda top: _way(start, top, pace), length)


def _most(low: float, high: float, way, length: float) -> float:
    """The greatest speed between two whose way is no longer than a length; `low` if its own is."""
    if way(high) <= length:
        return high
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if way(middle) <= length else (low, middle)
    return low


def _way(start: float, end: float, pace: Pace) -> float:
    """How far it goes while the speed changes, from no acceleration to none."""
    return (start + end) / 2.0 * sum(seconds for seconds, _ in _change(start, end, pace))


def _change(start: float, end: float, pace: Pace) -> tuple[tuple[float, float], ...]:
    """Durations and jerks while the speed changes: the acceleration rises, holds and falls."""
    gain = abs(end - start)
    jerk = pace.jerk if end > start else -pace.jerk
    ramp = min(pace.acceleration / pace.jerk, sqrt(gain / pace.jerk))
    hold = gain / (ramp * pace.jerk) - ramp if ramp > 0.0 else 0.0
    return (ramp, jerk), (hold, 0.0), (ramp, -jerk)
