"""Ranges of angles as lists of (first, last) [rad] on a line: joined, taken away, moved into."""

import numpy as np

Ranges = list[tuple[float, float]]


def joined(ranges: Ranges) -> Ranges:
    """The same angles in ranges that do not touch, in order."""
    out: Ranges = []
    for low, high in sorted(ranges):
        if out and low <= out[-1][1]:
            out[-1] = (out[-1][0], max(high, out[-1][1]))
        else:
            out.append((low, high))
    return out


def complement(taken: Ranges, low: float, high: float) -> Ranges:
    """What is left from `low` to `high` without ranges that do not touch and are in order."""
    ends = [low, *(end for span in taken for end in span), high]
    return [(a, b) for a, b in zip(ends[::2], ends[1::2], strict=True) if b > a]


def inside(angle: float, ranges: Ranges, inset: float) -> float:
    """The angle nearest to `angle`, up to whole turns, that lies in one of some ranges, `inset` or a quarter of its width off its ends."""
    best = np.inf
    for low, high in ranges:
        off = min(inset, (high - low) / 4.0)
        near = angle + 2 * np.pi * np.round(((low + high) / 2.0 - angle) / (2 * np.pi))
        found = float(np.clip(near, low + off, high - off))
        best = found if abs(found - near) < abs(best - near) else best
    return float(best)
