"""The planes of one object, from all that its scans show: faces seen, what it stands on, and rims, behind which faces must be.

Directions that are square to one another within what the data allow are made so; what lies on one plane is put together.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.geometry.transforms import apply, rotate
from handey_studio.modeling.patches import Patch, Patches

SQUARE_SIGMAS = 3.0  # a direction that is off by so many of its tilts may be square
LEAST_SQUARE_RAD, MOST_SQUARE_RAD = np.deg2rad(0.4), np.deg2rad(9.0)
SAME_SIGMAS, LEAST_SAME_M = 3.0, 0.0004  # offsets of one plane
SAME_RAD = np.deg2rad(3.0)  # normals of one plane, where they are not square
LEVEL = 0.2  # sine of a face's slope: less is level
WANDER = 1.5  # neighbouring readings of an outline err alike
LEAST_SIDE_M = 0.003  # shorter sides tell no direction
CERTAIN_M = 0.0001
UP = np.array([0.0, 0.0, 1.0])


class Clue(NamedTuple):
    """What tells of one plane: outward `normal` (3,), a `point` (3,) on it [m], how well its offset `sigma` [m] and its direction `tilt`
    [rad] are known, `kind` "seen", "support", "rim" or "cut", its `size` [m], the (scan, patch) it is from (patch -1: the support), and for
    a side of a patch's outline which (ring, side)."""

    normal: NDArray
    point: NDArray
    sigma: float
    tilt: float
    kind: str
    size: float
    of: tuple[int, int]
    side: tuple[int, int] = (-1, -1)


@dataclass(frozen=True, eq=False)
class BodyPlane(Value):
    """A plane of an object in the model frame: outward unit `normal` · x = `offset` [m], known to `sigma` [m] around `middle` (3,).

    `kind` is the best of what tells of it: "seen", "support" or "rim"; `size` [m] how much does; `of` names the (scan, patch) that lie on
    it, patch -1 for a support, `sides` the outlines' sides, (scan, patch, ring, side), that end there.
    """

    normal: NDArray
    offset: float
    middle: NDArray
    sigma: float
    kind: str
    size: float
    of: tuple[tuple[int, int], ...]
    sides: tuple[tuple[int, int, int, int], ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", frozen_array(self.normal))
        object.__setattr__(self, "middle", frozen_array(self.middle))


@dataclass(frozen=True)
class Squared:
    """A direction that was made square: the patch it is of, `kind` "right angle" or "parallel", by how much [rad] it was off, the limit."""

    of: tuple[int, int]
    kind: str
    off: float
    limit: float


class Body(NamedTuple):
    """An object as its scans show it: each `members` entry is a scan's number and its patches of the object."""

    patches: Sequence[Patches]
    Ts_model_scan: Sequence[NDArray]
    members: Sequence[tuple[int, tuple[int, ...]]]

    def patch(self, of: tuple[int, int]) -> Patch:
        return self.patches[of[0]].patches[of[1]]

    def ring(self, of: tuple[int, int]) -> NDArray:
        """A patch's outline (n, 3) [m] in the model frame; nothing for a support."""
        return apply(self.Ts_model_scan[of[0]], self.patch(of).rings[0]) if of[1] >= 0 else np.empty((0, 3))

    def of_all(self) -> list[tuple[int, int]]:
        return [(scan, patch) for scan, numbers in self.members for patch in numbers]


def body_planes(body: Body) -> tuple[tuple[BodyPlane, ...], list[Clue], NDArray, list[Squared]]:
    """The planes of an object, the surest first; the clues that tell of them, made square where they may be; the three directions (3, 3),
    rows, that these are square to; and what was made square."""
    raw = clues_of(body)
    frame = square_frame(raw)
    pairs = [squared(clue, frame, body.ring(clue.of)) for clue in raw]
    clues = [clue for clue, _ in pairs]
    return planes_of_body(clues), clues, frame, [square for _, square in pairs if square is not None]


def clues_of(body: Body) -> list[Clue]:
    """All that tells of planes, in the model frame."""
    clues = []
    for scan, numbers in body.members:
        T = body.Ts_model_scan[scan]
        below = _stood_on(body, scan, numbers)
        on_table = any(border.kind == "foot" for k in numbers for border in body.patch((scan, k)).borders[0])
        if on_table or not below:
            below_it = np.concatenate([body.patch((scan, k)).rings[0] for k in numbers]).mean(axis=0) * (1.0, 1.0, 0.0)
            clues.append(Clue(-rotate(T, UP), apply(T, below_it), CERTAIN_M, np.deg2rad(0.05), "support", 0.0, (scan, -1)))
        clues += below
        for number in numbers:
            clues.append(_seen(body, (scan, number)))
            clues += _rims(body.patch((scan, number)), T, (scan, number))
    return clues


def _seen(body: Body, of: tuple[int, int]) -> Clue:
    patch, T = body.patch(of), body.Ts_model_scan[of[0]]
    normal = rotate(T, patch.normal)
    middle = apply(T, patch.rings[0].mean(axis=0))
    middle = middle + (patch.offset + normal @ T[:3, 3] - normal @ middle) * normal
    return Clue(normal, middle, max(patch.bend, CERTAIN_M), patch.tilt, "seen", float(np.sqrt(max(patch.area, 0.0))), of)


def _stood_on(body: Body, scan: int, numbers: tuple[int, ...]) -> list[Clue]:
    """Upward faces of other objects that the object's sides end on: it stands there, not on the table."""
    patches = body.patches[scan].patches
    touched = {
        crease.a + crease.b - number
        for number in numbers
        for crease in body.patches[scan].creases
        if number in (crease.a, crease.b) and not crease.convex and abs(patches[number].normal[2]) < LEVEL
    }
    clues = []
    for other in sorted(touched - set(numbers)):
        if patches[other].normal[2] > 1.0 - LEVEL**2:
            below, up = _seen(body, (scan, other)), rotate(body.Ts_model_scan[scan], UP)
            normal = up if below.normal @ up > np.cos(limit_of(below)) else below.normal
            clues.append(below._replace(normal=-normal, kind="support", size=0.0))
    return clues


def _rims(patch: Patch, T: NDArray, of: tuple[int, int]) -> list[Clue]:
    """The sides of a patch that end it, as planes square to it."""
    clues = []
    for r, (ring, borders) in enumerate(zip(patch.rings, patch.borders, strict=True)):
        for s, (start, end, border) in enumerate(zip(ring, np.roll(ring, -1, axis=0), borders, strict=True)):
            length = float(np.linalg.norm(end - start))
            if border.kind in ("rim", "cut", "image") and length > LEAST_SIDE_M:
                outward = np.cross((end - start) / length, patch.normal)
                kind = "rim" if border.kind == "rim" else "cut"
                tilt = WANDER * np.sqrt(12.0) * max(border.sigma, CERTAIN_M) / length
                clues.append(Clue(rotate(T, outward), apply(T, 0.5 * (start + end)), border.sigma, tilt, kind, length, of, (r, s)))
    return clues


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
    weights = np.array([clue.size / (clue.tilt + np.deg2rad(0.3)) ** 2 for clue in around])
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


def limit_of(clue: Clue) -> float:
    """By how much [rad] a direction may be off and still be square."""
    return float(np.clip(SQUARE_SIGMAS * clue.tilt, LEAST_SQUARE_RAD, MOST_SQUARE_RAD))


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


def planes_of_body(clues: Sequence[Clue]) -> tuple[BodyPlane, ...]:
    """Clues that lie on one plane put together, the surest first; cuts are no planes."""
    groups: list[list[Clue]] = []
    for clue in sorted((c for c in clues if c.kind != "cut"), key=lambda c: (c.kind == "rim", c.sigma)):
        for group in groups:
            if _same_plane(group[0], clue):
                group.append(clue)
                break
        else:
            groups.append([clue])
    return tuple(_plane_of(group) for group in groups)


def _same_plane(one: Clue, other: Clue) -> bool:
    if one.normal @ other.normal < np.cos(SAME_RAD):
        return False
    apart = abs(one.normal @ (other.point - one.point))
    return bool(apart < max(LEAST_SAME_M, SAME_SIGMAS * float(np.hypot(one.sigma, other.sigma))))


def _plane_of(group: list[Clue]) -> BodyPlane:
    """The weighted mean of the clues of faces; of those of rims where there is none."""
    faces = [clue for clue in group if clue.kind != "rim"]
    surest = faces or group
    weights = np.array([max(clue.size, 0.001) / (clue.sigma + CERTAIN_M) ** 2 for clue in surest])
    normal = group[0].normal
    offset = float(np.average([normal @ clue.point for clue in surest], weights=weights))
    kind = min((clue.kind for clue in surest), key=("seen", "support", "rim").index)
    of = tuple(dict.fromkeys(clue.of for clue in faces))
    sides = tuple((*clue.of, *clue.side) for clue in group if clue.kind == "rim")
    middle = np.average([clue.point for clue in surest], axis=0, weights=weights)
    return BodyPlane(normal, offset, middle, min(clue.sigma for clue in surest), kind, sum(clue.size for clue in group), of, sides)
