"""What a body's scans tell of its planes, one clue for each thing seen: faces, what it stands on, and rims, behind which faces must be."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import apply, rotate
from handey_studio.modeling.patches.patch import Patch, Patches

SQUARE_SIGMAS = 3.0  # a direction that is off by so many of its tilts may be square
LEAST_SQUARE_RAD, MOST_SQUARE_RAD = np.deg2rad(0.4), np.deg2rad(9.0)
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


def limit_of(clue: Clue) -> float:
    """By how much [rad] a direction may be off and still be square."""
    return float(np.clip(SQUARE_SIGMAS * clue.tilt, LEAST_SQUARE_RAD, MOST_SQUARE_RAD))
