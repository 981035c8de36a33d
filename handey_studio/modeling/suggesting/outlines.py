"""The outline of a face of an object as lines in its plane: on the object's planes where it has them, without raggedness."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.geometry.transforms import apply
from handey_studio.modeling.suggesting.clues import Body, Clue
from handey_studio.modeling.suggesting.planes import BodyPlane
from handey_studio.modeling.suggesting.shapes import plane_with

LEAST_SLOPE = 0.1  # sine of the angle between planes whose meeting is a side
LEAST_APART_M = 0.0003  # corners of an outline


class Line(NamedTuple):
    """A side of a flat outline: outward · x = offset [m] in the cap's plane, `length` [m]; `cut` if a nearer thing hides what is beyond."""

    outward: NDArray
    offset: float
    length: float
    sigma: float
    cut: bool


def lines_of(body: Body, cap: Clue, ring: int, planes: Sequence[BodyPlane], basis: NDArray) -> list[Line]:
    """The sides of one ring of a cap's outline in its plane; where the object has a plane for a side, on that plane."""
    patch, T = body.patch(cap.of), body.Ts_model_scan[cap.of[0]]
    corners, level = apply(T, patch.rings[ring]) @ basis, plane_with(planes, cap.of).offset
    out = []
    for s, border in enumerate(patch.borders[ring]):
        start, end = corners[s, :2], corners[(s + 1) % len(corners), :2]
        length = float(np.linalg.norm(end - start))
        if length < 1e-6:
            continue
        outward = np.array([end[1] - start[1], start[0] - end[0]]) / length
        offset = float(outward @ (0.5 * (start + end)))
        plane = _plane_of_side(body, cap, ring, s, planes)
        if plane is not None:
            outward, offset = on_plane(plane, basis, level, outward, offset)
        out.append(Line(outward, offset, length, border.sigma, border.kind in ("cut", "image")))
    return out


def on_plane(plane: BodyPlane, basis: NDArray, level: float, outward: NDArray, offset: float) -> tuple[NDArray, float]:
    """The side where a plane meets the cap at `level` [m] along its normal, whichever way it looks; as it was if they hardly meet there."""
    flat = plane.normal @ basis[:, :2]
    size = float(np.linalg.norm(flat))
    if size < LEAST_SLOPE or abs(flat @ outward) < 0.9 * size:
        return outward, offset
    sign = 1.0 if flat @ outward > 0 else -1.0
    return sign * flat / size, sign * (plane.offset - float(plane.normal @ basis[:, 2]) * level) / size


def _plane_of_side(body: Body, cap: Clue, ring: int, side: int, planes: Sequence[BodyPlane]) -> BodyPlane | None:
    border = body.patch(cap.of).borders[ring][side]
    scan = cap.of[0]
    if border.kind == "crease":
        return next((plane for plane in planes if (scan, border.other) in plane.of), None)
    if border.kind == "foot":
        return next((plane for plane in planes if (scan, -1) in plane.of), None)
    return next((plane for plane in planes if (*cap.of, ring, side) in plane.sides), None)


def regular(lines: list[Line], short: float) -> list[Line]:
    """Sides without the sensor's raggedness: short ones left out, those on one line made one."""
    lines = list(lines)
    while len(lines) > 3:
        n = len(lines)
        joined = next((k for k in range(n) if _on_one_line(lines[k - 1], lines[k], short)), None)
        if joined is not None:
            lines[joined - 1] = _mean(lines[joined - 1], lines[joined])
            lines.pop(joined)
            continue
        shortest = min(range(n), key=lambda k: lines[k].length)
        if lines[shortest].length > short:
            break
        lines.pop(shortest)
    return lines


def _on_one_line(one: Line, other: Line, short: float) -> bool:
    alike = one.outward @ other.outward > (0.999 if min(one.length, other.length) > 2.0 * short else 0.94)
    return bool(alike and abs(one.offset - other.offset) < short)


def _mean(one: Line, other: Line) -> Line:
    """The longer side's direction; a side that planes tell wins."""
    first, second = sorted((one, other), key=lambda line: (line.sigma > 0, -line.length))
    if first.sigma == 0 or second.outward @ first.outward < 0.999 or second.length < 0.3 * first.length:
        return first._replace(length=one.length + other.length, cut=one.cut and other.cut)
    offset = float(np.average([one.offset, other.offset], weights=[one.length, other.length]))
    return Line(first.outward, offset, one.length + other.length, min(one.sigma, other.sigma), one.cut and other.cut)


def corners_of(lines: list[Line]) -> NDArray | None:
    """Where each side meets the one before (n, 2); None where they do not, or a side has no length."""
    corners = []
    for k in range(len(lines)):
        one, two = lines[k - 1], lines[k]
        cross = one.outward[0] * two.outward[1] - one.outward[1] * two.outward[0]
        if abs(cross) < 0.05:
            return None
        corners.append(np.linalg.solve(np.stack([one.outward, two.outward]), [one.offset, two.offset]))
    apart = np.linalg.norm(np.array(corners) - np.roll(corners, 1, axis=0), axis=1)
    return np.array(corners) if apart.min() > LEAST_APART_M else None


def polygon_of(rings: list[list[Line]]) -> shapely.Polygon | None:
    """The polygon with holes that outlines, the outer one first, enclose; None if the outer one has no corners or crosses itself."""
    outlines = [corners_of(ring) if len(ring) > 2 else None for ring in rings]
    if outlines[0] is None:
        return None
    polygon = shapely.Polygon(outlines[0], [hole for hole in outlines[1:] if hole is not None])
    return shapely.geometry.polygon.orient(polygon) if polygon.is_valid and polygon.area > 0 else None
