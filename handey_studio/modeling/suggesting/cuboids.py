"""Cuboids between the planes that end an object along three square directions."""

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry import Polyhedron, box
from handey_studio.geometry.transforms import apply, transform
from handey_studio.modeling.suggesting.clues import UP, Clue
from handey_studio.modeling.suggesting.planes import BodyPlane
from handey_studio.modeling.suggesting.shapes import ALONG, LEAST_THICK_M, MOST_ENDS, Shape, worth_of

ROUGHLY_ALONG, RAGGEDLY_ALONG = np.cos(np.deg2rad(20.0)), np.cos(np.deg2rad(40.0))  # sides of outlines, and those of ragged rims
MOSTLY = 0.5  # of the rims on one plane: they end there
OUTER_PART = 0.3  # of their length tells where ragged rims end
SAME_END_M, NEAR_END_M = 0.015, 0.02


def cuboids(clues: Sequence[Clue], planes: Sequence[BodyPlane], frame: NDArray) -> Iterator[Shape]:
    """Cuboids between the surest planes along the six directions of the frame, down to each plane where the object may end below."""
    ends = []
    for direction in np.concatenate([frame, -frame]):
        along = sorted((plane for plane in planes if plane.normal @ direction > ALONG), key=worth_of, reverse=True)
        found = [plane.offset for plane in (_ends_below(along)[:MOST_ENDS] if direction @ UP < -ALONG else along[:1])]
        if not found or along[0].kind == "rim":
            found = _rough_end(clues, direction, along[0].size if along else 0.0) or found
        hidden = _hidden(clues, direction, found[0] if found else -np.inf)
        if not found and hidden <= 0:
            yield Shape("cuboid", None, f"nothing shows where it ends along {_named(direction)}")
            return
        if hidden > 0 and not any(plane.kind != "rim" for plane in along):
            yield Shape("cuboid", None, f"a nearer thing hides where it ends along {_named(direction)}", hidden, 0.0, "m")
            return
        ends.append(found)
    for chosen in product(*ends):
        yield _cuboid(np.array(chosen[:3]), np.array(chosen[3:]), frame)


def _ends_below(along: Sequence[BodyPlane]) -> list[BodyPlane]:
    """The planes where an object may end below, without rims beside what it may stand on: they are the same end, less sharp."""
    supports = [plane.offset for plane in along if plane.kind == "support"]
    return [p for p in along if p.kind != "rim" or all(abs(p.offset - offset) > SAME_END_M for offset in supports)]


def _rough_end(clues: Sequence[Clue], direction: NDArray, sure: float) -> list[float]:
    """Where rims that look roughly that way end: the mean of the outer part of them; empty if there are none, or if more than their half
    is `sure` [m] long, on one plane."""
    rims = [c for c in clues if c.kind == "rim" and c.side[0] == 0 and c.normal @ direction > RAGGEDLY_ALONG]
    sizes = np.array([c.size * float(c.normal @ direction) for c in rims])
    if not rims or sure >= MOSTLY * sizes.sum():
        return []
    offsets = np.array([float(c.point @ direction) for c in rims])
    order = np.argsort(-offsets)
    offsets, sizes = offsets[order], sizes[order]
    outer = np.cumsum(sizes) - sizes < OUTER_PART * sizes.sum()
    return [float(np.average(offsets[outer], weights=sizes[outer]))]


def _hidden(clues: Sequence[Clue], direction: NDArray, end: float) -> float:
    """How much more [m] of the sides that look that way is cut off than ends, near the end or beyond."""
    looking = [c for c in clues if c.normal @ direction > ROUGHLY_ALONG and c.point @ direction > end - NEAR_END_M]
    lengths = {kind: sum(c.size for c in looking if c.kind == kind) for kind in ("cut", "rim")}
    return lengths["cut"] - lengths["rim"]


def _cuboid(high: NDArray, low: NDArray, frame: NDArray) -> Shape:
    """The cuboid up to `high` (3,) along the frame's directions and to `low` (3,) against them [m]."""
    size = high + low
    option = "cuboid of " + " × ".join(f"{1e3 * length:.1f}" for length in size) + " mm"
    if size.min() < LEAST_THICK_M:
        return Shape(option, None, "it would be too thin", float(size.min()), LEAST_THICK_M, "m")
    solid = box(size)
    return Shape(option, Polyhedron(apply(transform(frame.T, 0.5 * (high - low) @ frame), solid.vertices), solid.faces))


def _named(direction: NDArray) -> str:
    return "(" + ", ".join(f"{value + 0.0:.2f}" for value in direction) + ")"
