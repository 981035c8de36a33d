"""Closed solids that an object may be: cuboids, prisms on each face seen, and columns under all faces that look up."""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import manifold3d
import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron, box, polyhedron_from_polygons, prism
from handey_studio.geometry.transforms import apply, transform
from handey_studio.modeling.suggest_planes import UP, Body, BodyPlane, Clue

ALONG = np.cos(np.deg2rad(1.0))  # planes along an axis
ROUGHLY_ALONG, RAGGEDLY_ALONG = np.cos(np.deg2rad(20.0)), np.cos(np.deg2rad(40.0))  # ragged rims, where nothing better is known
SAME_END_M = 0.015
OUTER_PART = 0.3  # of their length tells where they end
NEAR_END_M = 0.02
LEAST_THICK_M = 0.002
LEAST_SLOPE = 0.1  # sine of the angle between planes whose meeting is a side
SEEN_WORTH = 3.0  # a face that is seen tells three times as much as a rim of that length
INTO_M = 0.001  # columns reach into higher ones beside them
NEAR_STEP_M = 0.006  # so near to where a higher face hides the lower one its side goes down
MOST_ENDS = 3
MOSTLY = 0.5
LEAST_APART_M = 0.0003  # corners of an outline
EXACT_DIGITS = 7  # a ten thousandth of a millimetre


class Shape(NamedTuple):
    """A candidate: `option` names it; `solid` None if it cannot be, with the `reason` and number."""

    option: str
    solid: Polyhedron | None
    reason: str = ""
    value: float | None = None
    limit: float | None = None
    unit: str = ""


class Line(NamedTuple):
    """A side of a flat outline: outward · x = offset [m] in the cap's plane, `length` [m]; `cut` if a nearer thing hides what is beyond."""

    outward: NDArray
    offset: float
    length: float
    sigma: float
    cut: bool


def shapes_of(body: Body, clues: Sequence[Clue], planes: Sequence[BodyPlane], frame: NDArray, short: float) -> Iterator[Shape]:
    """All candidates for an object; `short` [m]: outlines' sides below are the sensor's raggedness."""
    yield from cuboids(clues, planes, frame)
    caps = [clue for clue in clues if clue.kind == "seen"]
    most = max((clue.size for clue in caps), default=0.0)
    for cap in caps:
        if cap.size > 0.25 * most:
            yield from prisms(body, cap, planes, short)
    upward = [cap for cap in caps if cap.normal @ UP > 0.2]
    if upward and (len(upward) > 1 or upward[0].normal @ UP < ALONG):
        yield columns(body, upward, planes, _upright(frame), short)


def cuboids(clues: Sequence[Clue], planes: Sequence[BodyPlane], frame: NDArray) -> Iterator[Shape]:
    """Cuboids between the surest planes along the six directions of the frame, down to each plane where the object may end below."""
    ends = []
    for direction in np.concatenate([frame, -frame]):
        along = sorted((plane for plane in planes if plane.normal @ direction > ALONG), key=_worth, reverse=True)
        found = [plane.offset for plane in (_below(along)[:MOST_ENDS] if direction @ UP < -ALONG else along[:1])]
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


def _below(along: Sequence[BodyPlane]) -> list[BodyPlane]:
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


def _worth(plane: BodyPlane) -> tuple[bool, float]:
    """How much speaks for an end: of what it may stand on the highest, else faces and rims by their size."""
    if plane.kind == "support":
        return True, -plane.offset
    return False, plane.size * (SEEN_WORTH if plane.kind == "seen" else 1.0)


def _named(direction: NDArray) -> str:
    return "(" + ", ".join(f"{value + 0.0:.2f}" for value in direction) + ")"


def prisms(body: Body, cap: Clue, planes: Sequence[BodyPlane], short: float) -> Iterator[Shape]:
    """A seen face extruded back to each plane where the object may end."""
    option = f"face {cap.of[1] + 1} of scan {cap.of[0] + 1}"
    top = _plane_with(planes, cap.of)
    ends = [plane for plane in planes if plane.normal @ cap.normal < -ALONG and top.offset + plane.offset > LEAST_THICK_M]
    if not ends:
        yield Shape(f"{option} extruded", None, "nothing shows how far it reaches back")
        return
    basis = _basis(cap.normal)
    rings = [_regular(_lines(body, cap, ring, planes, basis), short) for ring in range(len(body.patch(cap.of).rings))]
    for end in sorted(ends, key=_worth, reverse=True)[:MOST_ENDS]:
        depth = top.offset + end.offset
        yield _extruded(f"{option} extruded by {1e3 * depth:.1f} mm", rings, basis, top.offset, depth)


def _extruded(option: str, rings: list[list[Line]], basis: NDArray, offset: float, depth: float) -> Shape:
    cut = [line for line in rings[0] if line.cut]
    if cut:
        return Shape(option, None, "the face is cut off by a nearer thing", max(line.length for line in cut), 0.0, "m")
    polygon = _polygon(rings)
    if polygon is None:
        return Shape(option, None, "its outline has no simple polygon")
    try:
        solid = _prism(polygon, depth)
    except BadInput as error:
        return Shape(option, None, str(error).rstrip("."))
    T = transform(basis, basis[:, 2] * (offset - depth))
    return Shape(option, Polyhedron(apply(T, solid.vertices), solid.faces))


def _basis(normal: NDArray) -> NDArray:
    """A rotation (3, 3) whose third column is the normal."""
    x = np.cross(UP, normal) if abs(normal @ UP) < 0.9 else np.array([1.0, 0.0, 0.0])
    x = x - (x @ normal) * normal
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(normal, x), normal], axis=1)


def _plane_with(planes: Sequence[BodyPlane], of: tuple[int, int]) -> BodyPlane:
    return next(plane for plane in planes if of in plane.of)


def _lines(body: Body, cap: Clue, ring: int, planes: Sequence[BodyPlane], basis: NDArray) -> list[Line]:
    """The sides of one ring of a cap's outline in its plane; where the object has a plane for a side, on that plane."""
    patch, T = body.patch(cap.of), body.Ts_model_scan[cap.of[0]]
    corners, level = apply(T, patch.rings[ring]) @ basis, _plane_with(planes, cap.of).offset
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
            outward, offset = _on_plane(plane, basis, level, outward, offset)
        out.append(Line(outward, offset, length, border.sigma, border.kind in ("cut", "image")))
    return out


def _on_plane(plane: BodyPlane, basis: NDArray, level: float, outward: NDArray, offset: float) -> tuple[NDArray, float]:
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


def _regular(lines: list[Line], short: float) -> list[Line]:
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


def _corners(lines: list[Line]) -> NDArray | None:
    """Where neighbouring sides meet (n, 2); None where they do not, or a side has no length."""
    corners = []
    for k in range(len(lines)):
        one, two = lines[k - 1], lines[k]
        cross = one.outward[0] * two.outward[1] - one.outward[1] * two.outward[0]
        if abs(cross) < 0.05:
            return None
        corners.append(np.linalg.solve(np.stack([one.outward, two.outward]), [one.offset, two.offset]))
    apart = np.linalg.norm(np.array(corners) - np.roll(corners, 1, axis=0), axis=1)
    return np.array(corners) if apart.min() > LEAST_APART_M else None


def _polygon(rings: list[list[Line]]) -> shapely.Polygon | None:
    outlines = [_corners(ring) if len(ring) > 2 else None for ring in rings]
    if outlines[0] is None:
        return None
    polygon = shapely.Polygon(outlines[0], [hole for hole in outlines[1:] if hole is not None])
    return shapely.geometry.polygon.orient(polygon) if polygon.is_valid and polygon.area > 0 else None


def _prism(polygon: shapely.Polygon, height: float) -> Polyhedron:
    """A polygon with holes extruded from z = 0 [m]."""
    loops = [np.asarray(ring.coords)[:-1] for ring in (polygon.exterior, *polygon.interiors)]
    if len(loops) == 1:
        return prism(loops[0], height)
    section = manifold3d.CrossSection([np.array(loops[0])])
    for hole in loops[1:]:
        section = section - manifold3d.CrossSection([np.array(hole[::-1])])
    return _solid_of(manifold3d.Manifold.extrude(section, height))


def _solid_of(made: manifold3d.Manifold) -> Polyhedron:
    mesh = made.to_mesh64()
    return polyhedron_from_polygons(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).tolist())


def columns(body: Body, upward: Sequence[Clue], planes: Sequence[BodyPlane], upright: NDArray, short: float) -> Shape:
    """All that stands below the faces that look up, down to the support. `upright` (3, 3): rows are directions in which sides are made
    exact, so that those on one plane become one face, the third up."""
    option = f"columns under {len(upward)} faces"
    made = manifold3d.Manifold()
    for cap in upward:
        lines = _regular(_stepped(body, cap, _lines(body, cap, 0, planes, _basis(cap.normal)), planes), short)
        if any(line.cut for line in lines):
            return Shape(
                option, None, f"face {cap.of[1] + 1} is cut off by a nearer thing", max(x.length for x in lines if x.cut), 0.0, "m"
            )
        polygon = _polygon([lines])
        if polygon is None:
            return Shape(option, None, f"the outline of face {cap.of[1] + 1} has no simple polygon")
        made = made + _column(polygon, cap, _plane_with(planes, cap.of), upright)
    try:
        solid = _solid_of(made)
    except BadInput as error:
        return Shape(option, None, str(error).rstrip("."))
    return Shape(option, Polyhedron(solid.vertices @ upright, solid.faces))


def _upright(frame: NDArray) -> NDArray:
    """The frame's level directions and up, as rows; those of the world where it is tilted."""
    if abs(frame[2] @ UP) < ALONG:
        return np.eye(3)
    return np.stack([frame[0], np.cross(UP, frame[0]), UP])


def _stepped(body: Body, cap: Clue, lines: list[Line], planes: Sequence[BodyPlane]) -> list[Line]:
    """Sides where a higher face of the same object hides nothing more than a step: they reach a little into what is below that."""
    basis, level = _basis(cap.normal), _plane_with(planes, cap.of).offset
    rising = {c.a + c.b - cap.of[1] for c in body.patches[cap.of[0]].creases if cap.of[1] in (c.a, c.b) and not c.convex}
    own = {patch for scan, patches in body.members if scan == cap.of[0] for patch in patches}
    out = []
    for line, border in zip(lines, body.patch(cap.of).borders[0], strict=False):
        if border.other in own and (border.kind == "cut" or (border.kind == "crease" and border.other in rising)):
            facing = [p for p in planes if p.normal @ basis[:, :2] @ line.outward < -0.97 and abs(p.offset + line.offset) < NEAR_STEP_M]
            outward, offset = line.outward, line.offset
            if facing:
                nearest = min(facing, key=lambda p: abs(p.offset + line.offset))
                outward, offset = _on_plane(nearest, basis, level, outward, offset)
            line = line._replace(outward=outward, offset=offset + INTO_M, cut=False)
        out.append(line)
    return out


def _column(polygon: shapely.Polygon, cap: Clue, top: BodyPlane, upright: NDArray) -> manifold3d.Manifold:
    """What lies straight below a polygon of the cap's plane, down to z = 0, in the directions `upright`."""
    basis = _basis(cap.normal)
    corners = np.asarray(polygon.exterior.coords)[:-1]
    points = np.round(np.c_[corners, np.full(len(corners), top.offset)] @ basis.T @ upright.T, EXACT_DIGITS)
    high = float(points[:, 2].max()) + 1.0
    block = manifold3d.Manifold.extrude(manifold3d.CrossSection([points[:, :2].copy()]), high)
    return block.trim_by_plane(tuple(-upright @ cap.normal), -top.offset)
