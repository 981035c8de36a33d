"""Directions of a body's planes that are square to one another within what the data allow, made so."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.modeling.suggesting.clues import LEVEL, MOST_SQUARE_RAD, UP, Clue, limit_of

ROUGH_RAD = np.deg2rad(0.3)  # no direction counts as surer than this


@dataclass(frozen=True)
class Squared:
    """A direction that was made square: the patch it is of, `kind` "right angle" or "parallel", by how much [rad] it was off, the limit."""

    of: tuple[int, int]
    kind: str
    off: float
    limit: float


def square_frame(clues: Sequence[Clue]) -> NDArray:
    """Three directions (3, 3), rows, that most of the object's planes are square to: the support's normal if any face agrees with it."""
    seen = [clue for clue in clues if clue.kind == "seen"]
    ups = [clue.normal for clue in clues if clue.kind == "support"] or [UP]
    first = -ups[0]
    if not any(_off_square(clue.normal, first) <= limit_of(clue) for clue in seen):
        first = max(seen, key=lambda clue: clue.size).normal if seen else UP
    return _turned(first, [clue for clue in clues if clue.kind in ("seen", "rim")])


def _turned(first: NDArray, clues: Sequence[Clue]) -> NDArray:
    """The frame about `first` that most clues square to it agree with, by size and tilt."""
    x = np.cross(first, [1.0, 0.0, 0.0] if abs(first[0]) < 0.7 else [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    y = np.cross(first, x)
    around = [clue for clue in clues if abs(clue.normal @ first) < np.sin(limit_of(clue)) and clue.tilt < MOST_SQUARE_RAD]
    if not around:
        return np.stack([x, y, first])
    angles = np.array([np.arctan2(clue.normal @ y, clue.normal @ x) for clue in around])
    weights = np.array([clue.size / (clue.tilt + ROUGH_RAD) ** 2 for clue in around])
    limits = np.array([limit_of(clue) for clue in around])
    off = _quarter(angles[None] - angles[:, None])
    alike = np.abs(off) < np.minimum(limits[None], limits[:, None])
    best = int(np.argmax((alike * weights).sum(axis=1)))
    angle = angles[best] + float((off[best] * weights * alike[best]).sum() / (weights * alike[best]).sum())
    axis = np.cos(angle) * x + np.sin(angle) * y
    return np.stack([axis, np.cross(first, axis), first])


def _quarter(angle: NDArray) -> NDArray:
    """Angles [rad] to the nearest quarter turn."""
    return (angle + np.pi / 4) % (np.pi / 2) - np.pi / 4


def _off_square(normal: NDArray, axis: NDArray) -> float:
    """Angle [rad] from being along an axis or across it."""
    along = float(np.arccos(np.clip(abs(normal @ axis), 0.0, 1.0)))
    return min(along, float(np.pi / 2) - along)


def squared(clue: Clue, frame: NDArray, ring: NDArray) -> tuple[Clue, Squared | None]:
    """The clue with its normal along an axis of the frame, or across one, where it is within its limit of that.

    A top that is a little out of level is taken at the highest corner of `ring` (n, 3): lids sag, and what is put on them meets that.
    """
    limit = limit_of(clue)
    cosines = frame @ clue.normal
    nearest = int(np.argmax(np.abs(cosines)))
    off = float(np.arccos(np.clip(abs(cosines[nearest]), 0.0, 1.0)))
    if off <= limit:
        return _levelled(clue, np.sign(cosines[nearest]) * frame[nearest], ring), Squared(clue.of, "parallel", off, limit)
    across = int(np.argmin(np.abs(cosines)))
    off = float(np.arcsin(np.clip(abs(cosines[across]), 0.0, 1.0)))
    if off <= limit:
        normal = clue.normal - cosines[across] * frame[across]
        return _levelled(clue, normal / np.linalg.norm(normal), ring), Squared(clue.of, "right angle", off, limit)
    return clue, None


def _levelled(clue: Clue, normal: NDArray, ring: NDArray) -> Clue:
    if clue.kind == "rim":  # a rim that was turned is as unsure as its ends have moved
        turned = float(np.arccos(np.clip(clue.normal @ normal, -1.0, 1.0)))
        return clue._replace(normal=normal, sigma=float(np.hypot(clue.sigma, turned * clue.size / np.sqrt(12.0))))
    if clue.kind != "seen" or normal @ UP < 1.0 - LEVEL**2:
        return clue._replace(normal=normal)
    corners = ring - ((ring - clue.point) @ clue.normal)[:, None] * clue.normal
    return clue._replace(normal=normal, point=corners[int(np.argmax(corners @ normal))])
