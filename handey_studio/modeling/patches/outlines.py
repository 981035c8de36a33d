"""Outlines of patches: their contours as straight sides, each told by what lies beyond it.

Where two planes meet, their intersection is the side; where the object ends, the contour is, with what the sensor loses there added back.
"""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.modeling.patches.patch import Border
from handey_studio.modeling.patches.sides import PARALLEL_RAD, Seen, Side, beyond_of, lifted, moved_out, scale_of, side_of

LEAST_HOLE = 0.3  # of a hole's pixels must be seen on other things
LEAST_HOLE_PX = 40
SIMPLE_PX, RAGGED = 1.5, 1.2  # a contour's side may leave a straight line by so much, and by this share of the outline error
COARSER = (1.0, 1.6, 2.5)  # times as much where the sides would cross one another
LEAST_SIDE_PX, SAME_LINE = 0.3, np.cos(np.deg2rad(1.0))
SHORT = 3.5  # slacks: a shorter side may be a rounded corner
MEET_SLACKS, MEET_PX = 6.0, 8.0  # lines that meet farther from their corner do not make it
RIM_SHARE = 0.7  # of the pixels of a stretch that is a rim
TRIM = 0.12  # of a side at each end belongs to the corner


class Contour(NamedTuple):
    """The outermost pixels (n, 2) of a patch, or those around a hole in it, in order, and what lies beyond each, as `beyond_of` tells."""

    pixels: NDArray
    hole: bool
    kinds: NDArray
    others: NDArray


class Ring(NamedTuple):
    """One outline of a patch: `corners` (n, 3) [m] in the world's frame and what its sides are."""

    corners: NDArray
    borders: tuple[Border, ...]


def contours_of(seen: Seen, number: int, part: tuple[slice, slice]) -> list[Contour]:
    """The outer contour of a patch, then those of its holes. `part` is the rectangle of the image that the patch lies in."""
    top, left = part[0].start - 1, part[1].start - 1
    mask = np.pad((seen.labels[part] == number).astype(np.uint8), 1)
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    mask[[0, -1]] = 0
    mask[:, [0, -1]] = 0
    contours, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return []
    outer = max((k for k in range(len(contours)) if tree[0][k][3] < 0), key=lambda k: cv2.contourArea(contours[k]))
    chosen = [outer, *(k for k in range(len(contours)) if tree[0][k][3] == outer and _is_hole(seen, contours[k], left, top))]
    found = []
    for k in chosen:
        pixels = contours[k][:, 0] + np.array([left, top], float)
        found.append(Contour(pixels, k != outer, *beyond_of(seen, number, pixels)))
    return found


def outlines_of(seen: Seen, number: int, contours: Sequence[Contour]) -> list[Ring]:
    """The outer outline of a patch, counter-clockwise seen from outside, and those of its holes, clockwise; empty when it has none."""
    found = [_outline(seen, number, contour) for contour in contours]
    return [outline for outline in found if outline is not None] if found and found[0] is not None else []


def rims_of(seen: Seen, number: int, contour: Contour) -> list[NDArray]:
    """The stretches (n, 2) [px] of a contour where the object ends, each about straight, in order."""
    if len(contour.pixels) < 8:
        return []
    corners = _corner_numbers(contour.pixels, _slack(seen, scale_of(seen, contour.pixels, number)))
    stretches = [_trimmed(a, b, len(contour.pixels)) for a, b in zip(corners, np.roll(corners, -1), strict=True)]
    return [contour.pixels[stretch] for stretch in stretches if (contour.kinds[stretch] == "r").mean() > RIM_SHARE]


def _is_hole(seen: Seen, contour: NDArray, left: int, top: int) -> bool:
    """Whether other things are seen through it: lost readings make no hole."""
    if cv2.contourArea(contour) < LEAST_HOLE_PX:
        return False
    low, high = contour[:, 0].min(axis=0), contour[:, 0].max(axis=0)
    inside = np.zeros((high - low + 1)[::-1], np.uint8)
    cv2.drawContours(inside, [contour - low], 0, 1, -1)
    v, u = np.nonzero(inside)
    return bool(np.isfinite(seen.view.depth[v + low[1] + top, u + low[0] + left]).mean() > LEAST_HOLE)


def _outline(seen: Seen, number: int, contour: Contour) -> Ring | None:
    """The outline with straight sides of a contour of patch `number`; None if it cannot be had without crossings."""
    if len(contour.pixels) < 8:
        return None
    pixels_per_m = scale_of(seen, contour.pixels, number)
    for coarser in COARSER:
        found = _polygon(seen, number, contour, _slack(seen, pixels_per_m) * coarser, pixels_per_m)
        if found is not None and is_simple(found.corners, seen.planes[number, :3]):
            ring, borders = found
            if (_signed_area(ring, seen.planes[number, :3]) < 0) != contour.hole:
                ring, borders = ring[::-1], (*borders[-2::-1], borders[-1])
            return Ring(ring, borders)
    return None


def _slack(seen: Seen, pixels_per_m: float) -> float:
    """How far [px] a contour may leave its straight sides."""
    return max(SIMPLE_PX, RAGGED * seen.view.outline_error * pixels_per_m)


def _polygon(seen: Seen, number: int, contour: Contour, slack: float, pixels_per_m: float) -> Ring | None:
    """Straight sides that leave the contour by at most about `slack` [px]."""
    corners = _corner_numbers(contour.pixels, slack)
    if len(corners) < 3:
        return None
    sides = []
    for a, b in zip(corners, np.roll(corners, -1), strict=True):
        inside = _trimmed(a, b, len(contour.pixels))
        sides.append(side_of(seen, number, contour.pixels[inside], contour.kinds[inside], contour.others[inside]))
    sides, places = moved_out(seen, sides, pixels_per_m), contour.pixels[corners]
    while len(sides) > 2:
        corners = _met(sides, places, slack)
        drop = next((k for k in (_repeated(sides), _needless(sides, places, slack), _pointless(corners)) if k is not None), None)
        if drop is None:
            return Ring(lifted(seen, number, corners), tuple(side.border for side in sides))
        sides.pop(drop)
        places = np.delete(places, drop, axis=0)
    return None


def _repeated(sides: list[Side]) -> int | None:
    """A side on the same crease as the one before."""
    for k, side in enumerate(sides):
        before = sides[k - 1]
        same = side.border.kind in ("crease", "foot") and (before.border.kind, before.border.other) == (side.border.kind, side.border.other)
        if same and abs(before.along @ side.along) > SAME_LINE:
            return k
    return None


def _pointless(corners: NDArray) -> int | None:
    """A side without length."""
    lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    return int(np.argmin(lengths)) if lengths.min() < LEAST_SIDE_PX else None


def _needless(sides: list[Side], places: NDArray, slack: float) -> int | None:
    """A short side whose neighbours meet near it: a corner that the sensor rounded."""
    n = len(sides)
    lengths = np.linalg.norm(np.roll(places, -1, axis=0) - places, axis=1)
    for k in np.argsort(lengths):
        if n <= 3 or lengths[k] > SHORT * slack:
            return None
        meeting = _meeting(sides[k - 1], sides[(k + 1) % n])
        if meeting is not None and np.linalg.norm(meeting - 0.5 * (places[k] + places[(k + 1) % n])) < SHORT * slack:
            return int(k)
    return None


def _corner_numbers(contour: NDArray, slack: float) -> NDArray:
    """Which contour pixels are corners of the polygon that leaves it by at most `slack` [px]."""
    polygon = cv2.approxPolyDP(np.rint(contour).astype(np.int32)[:, None], slack, True)[:, 0]
    place = {tuple(point): k for k, point in enumerate(np.rint(contour).astype(int).tolist())}
    numbers = sorted({place[tuple(point)] for point in polygon.tolist()})
    return np.array(numbers)


def _trimmed(a: int, b: int, n: int) -> NDArray:
    """Numbers of the contour's pixels from a to b, without those beside the corners."""
    length = (b - a) % n or n
    cut = int(TRIM * length)
    return np.arange(a + cut, a + length - cut + 1) % n


def _meeting(one: Side, two: Side) -> NDArray | None:
    """Where two lines in the image meet; None for those that are about parallel."""
    p, d, q, e = one.middle, one.along, two.middle, two.along
    cross = d[0] * e[1] - d[1] * e[0]
    if abs(cross) < np.sin(PARALLEL_RAD):
        return None
    return p + ((q[0] - p[0]) * e[1] - (q[1] - p[1]) * e[0]) / cross * d


def _met(sides: list[Side], corners: NDArray, slack: float) -> NDArray:
    """Corners (n, 2) [px] where neighbouring lines meet; where they hardly do, the middle of both lines' nearest points."""
    out = []
    for k, place in enumerate(corners):
        meeting = _meeting(sides[k - 1], sides[k])
        if meeting is None or np.linalg.norm(meeting - place) > MEET_SLACKS * slack + MEET_PX:
            meeting = np.mean([s.middle + ((place - s.middle) @ s.along) * s.along for s in (sides[k - 1], sides[k])], axis=0)
        out.append(meeting)
    return np.array(out)


def _signed_area(ring: NDArray, normal: NDArray) -> float:
    return 0.5 * float(np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0) @ normal)


def area_of(rings: list[NDArray], normal: NDArray) -> float:
    """Area [m²] inside the outer ring and outside the holes."""
    return float(sum(_signed_area(ring, normal) for ring in rings))


def is_simple(ring: NDArray, normal: NDArray) -> bool:
    """Whether a ring does not cross itself."""
    x = np.linalg.svd(normal[None])[2][1]
    flat = ring @ np.stack([x, np.cross(normal, x)], axis=1)
    return bool(shapely.Polygon(flat).is_valid)
