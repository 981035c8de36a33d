"""The planes of one object, from all that its scans show: clues that lie on one plane, put together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.modeling.suggesting.clues import CERTAIN_M, Body, Clue, clues_of
from handey_studio.modeling.suggesting.squares import Squared, square_frame, squared

SAME_SIGMAS, LEAST_SAME_M = 3.0, 0.0004  # offsets of one plane
SAME_RAD = np.deg2rad(3.0)  # normals of one plane, where they are not square


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


def body_planes(body: Body) -> tuple[tuple[BodyPlane, ...], list[Clue], NDArray, list[Squared]]:
    """The planes of an object, the surest first; the clues that tell of them, made square where they may be; the three directions (3, 3),
    rows, that these are square to; and what was made square."""
    raw = clues_of(body)
    frame = square_frame(raw)
    pairs = [squared(clue, frame, body.ring(clue.of)) for clue in raw]
    clues = [clue for clue, _ in pairs]
    return planes_of_body(clues), clues, frame, [square for _, square in pairs if square is not None]


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
