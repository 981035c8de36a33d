"""Smooth ways through configurations: what the arm follows, what the certificate speaks of, and what is timed.

A curve is made of cubic pieces whose first and second derivatives join; where the first ones do not, the arm has to stop. Its parameter
is the time [s] that the way would take if only the joints' speeds were limited.
"""

from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array

SAMPLE_S = 0.008  # between a trajectory's samples: the pace of an arm's controller, 125 a second
CHORD_RAD = 1e-4  # a curved piece is cut into chords that it leaves by no more than this
MOST_CHORDS = 16
STRAIGHT = 1e-6  # a second derivative [rad/s²] below this is rounding
LEAST_S = 1e-6  # a blend that is shorter is none
RAMP = 1.0 / 3.0  # share of a blend in which the change of its direction sets in, and in which it ends


@dataclass(frozen=True, eq=False)
class Curve(Value):
    """`ends` (m + 1,) [s]: where the pieces begin and end, from 0; `pieces` (m, 4, joints): their coefficients, the constant one first,
    in the parameter counted from where the piece begins."""

    ends: NDArray
    pieces: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "ends", frozen_array(self.ends))
        object.__setattr__(self, "pieces", frozen_array(self.pieces))

    @property
    def lengths(self) -> NDArray:
        """(m,) [s] of the pieces."""
        return np.diff(self.ends)

    def at(self, s: NDArray, order: int = 0) -> NDArray:
        """Configurations (k, joints) [rad] at parameters s (k,), or their derivatives of an order from 1 to 3."""
        piece = np.clip(np.searchsorted(self.ends, s, side="right") - 1, 0, len(self.pieces) - 1)
        return _values(self.pieces[piece], s - self.ends[piece], order)

    def ending(self, order: int) -> NDArray:
        """What each piece (m, joints) comes to at its end: its place, or its derivative of an order from 1 to 3."""
        return _values(self.pieces, self.lengths, order)

    def reach(self, order: int) -> NDArray:
        """The most (m, joints) that a derivative of an order from 1 to 3 comes to on each piece, as an absolute value."""
        looks = [_values(self.pieces, 0.0 * self.lengths, order), self.ending(order)]
        if order == 1:
            with np.errstate(divide="ignore", invalid="ignore"):
                turn = np.nan_to_num(-self.pieces[:, 2] / (3.0 * self.pieces[:, 3]), nan=0.0, posinf=0.0, neginf=0.0)
            turn = np.clip(turn, 0.0, self.lengths[:, None])
            looks.append(self.pieces[:, 1] + turn * (2.0 * self.pieces[:, 2] + turn * 3.0 * self.pieces[:, 3]))
        return np.abs(looks).max(axis=0)

    def reversed(self) -> "Curve":
        """The same way from its end to its start."""
        values = [(-1.0) ** order / factorial(order) * self.ending(order) for order in range(4)]
        return Curve((self.ends[-1] - self.ends)[::-1], np.stack(values, axis=1)[::-1])

    def chords(self) -> tuple[NDArray, NDArray]:
        """Parameters (k + 1,) between which the curve is straight but for so much (k, joints) [rad]; every piece begins at one of them.

        A straight piece is one chord. Along curved ones the lines between a trajectory's samples count as well: they are within what is
        told, too, as the parameter never runs faster than time.
        """
        bend, h = self.reach(2), self.lengths
        bend[bend.max(axis=1) < STRAIGHT] = 0.0
        counts = np.clip(np.ceil(h * np.sqrt(bend.max(axis=1) / (8.0 * CHORD_RAD))), 1, MOST_CHORDS).astype(int)
        around = np.concatenate([bend[:1], bend, bend[-1:]])
        sampled = np.where(bend.any(axis=1, keepdims=True), np.max([around[:-2], around[1:-1], around[2:]], axis=0), 0.0)
        off = (bend * (h / counts)[:, None] ** 2 + sampled * SAMPLE_S**2) / 8.0
        share = np.concatenate([np.arange(n) / n for n in counts])
        s = np.repeat(self.ends[:-1], counts) + share * np.repeat(h, counts)
        return np.append(s, self.ends[-1]), np.repeat(off, counts, axis=0)


def _values(pieces: NDArray, s: NDArray, order: int = 0) -> NDArray:
    """Value (k, joints), or a derivative, of each piece (k, 4, joints) at its own parameter (k,)."""
    powers = np.zeros((len(s), 4))
    for k in range(order, 4):
        powers[:, k] = factorial(k) / factorial(k - order) * s ** (k - order)
    return np.einsum("kp,kpj->kj", powers, pieces)


def rounded(points: NDArray, reaches: NDArray, velocity: NDArray) -> Curve:
    """The polyline through points (n, joints) [rad] with a blend around each corner that begins and ends `reaches` (n,) [s] from it.

    The curve's parameter runs as that of the polyline would. In a blend the direction changes from one segment's to the next one's: with
    an even third derivative for a third of it, evenly for a third, and to rest again. So each joint's speed stays between those of the two
    segments, and the blend in the triangle of its corner and its ends. A reach below a microsecond leaves the corner. Consecutive points
    must differ; reaches at the ends are not looked at.
    """
    steps = np.diff(points, axis=0)
    spans = (np.abs(steps) / velocity).max(axis=1)
    along = steps / spans[:, None]
    rounds = np.where(reaches < LEAST_S, 0.0, reaches) * np.r_[0.0, np.ones(len(points) - 2), 0.0]
    lengths, pieces, still = [], [], np.zeros(points.shape[1])
    for k in range(len(spans)):
        before, after = rounds[k : k + 2]
        if spans[k] - before - after > 1e-12:
            lengths.append(spans[k] - before - after)
            pieces.append([points[k] + before * along[k], along[k], still, still])
        if after > 0.0:
            lengths += [2.0 * RAMP * after, 2.0 * (1.0 - 2.0 * RAMP) * after, 2.0 * RAMP * after]
            pieces += _blend(points[k + 1] - after * along[k], along[k], along[k + 1], after)
    return Curve(np.concatenate([[0.0], np.cumsum(lengths)]), np.array(pieces))


def _blend(start: NDArray, before: NDArray, after: NDArray, reach: float) -> list[list[NDArray]]:
    """Coefficients of the three pieces of a blend that begins at `start` and is 2·`reach` long."""
    ramp, hold, still = 2.0 * RAMP * reach, 2.0 * (1.0 - 2.0 * RAMP) * reach, np.zeros_like(start)
    third = (after - before) / (4.0 * reach**2 * RAMP * (1.0 - RAMP))
    bend = third * ramp
    one = [start, before, still, third / 6.0]
    here, speed = start + ramp * before + third * ramp**3 / 6.0, before + third * ramp**2 / 2.0
    two = [here, speed, bend / 2.0, still]
    here, speed = here + hold * speed + bend * hold**2 / 2.0, speed + hold * bend
    return [one, two, [here, speed, bend / 2.0, -third / 6.0]]


def spline(points: NDArray, spans: NDArray) -> Curve:
    """The cubic B-spline whose control polygon goes through points (n, joints) [rad], with knots `spans` (n - 1,) [s] apart.

    It begins and ends where the polygon does, and between leaves it by about a sixth of how much the polygon bends: it cannot swing beyond.
    The first and the last control point are shifted so that the outer pieces are parabolas. Pieces by W. Böhm's construction of Bézier
    points, 1977.
    """
    control = np.array(points)
    if len(points) > 2:
        control[0], control[-1] = _outer(points[:3], spans[:3]), _outer(points[:-4:-1], spans[:-4:-1])
    h, steps = np.concatenate([spans[:1], spans, spans[-1:]]), np.diff(control, axis=0)
    wide = h[:-2] + h[1:-1] + h[2:]
    inner_1 = control[:-1] + (h[:-2] / wide)[:, None] * steps
    inner_2 = control[:-1] + ((h[:-2] + h[1:-1]) / wide)[:, None] * steps
    share = (spans[:-1] / (spans[:-1] + spans[1:]))[:, None]
    knots = np.concatenate([points[:1], inner_2[:-1] + share * (inner_1[1:] - inner_2[:-1]), points[-1:]])
    b, width = (knots[:-1], inner_1, inner_2, knots[1:]), spans[:, None]
    pieces = [b[0], 3.0 * (b[1] - b[0]) / width, 3.0 * (b[0] - 2.0 * b[1] + b[2]) / width**2]
    pieces.append((b[3] - b[0] + 3.0 * (b[1] - b[2])) / width**3)
    return Curve(np.concatenate([[0.0], np.cumsum(spans)]), np.stack(pieces, axis=1))


def _outer(points: NDArray, spans: NDArray) -> NDArray:
    """The outer control point (joints,) with which the piece from the first of points (3, joints) to the second has no third derivative."""
    h, next_h, far_h = spans[0], spans[1], spans[min(2, len(spans) - 1)]
    one, two, share = h / (2.0 * h + next_h), 2.0 * h / (2.0 * h + next_h), h / (h + next_h)
    following = points[1] + h / (h + next_h + far_h) * (points[2] - points[1])
    fixed = points[0] - share * following + ((2.0 + share) * two - 3.0 * one) * points[1]
    return fixed / (3.0 * (1.0 - one) - (2.0 + share) * (1.0 - two))
