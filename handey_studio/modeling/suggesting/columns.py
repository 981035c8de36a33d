"""All that stands below the faces of an object that look up."""

from collections.abc import Sequence

import manifold3d
import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron
from handey_studio.modeling.suggesting.clues import UP, Body, Clue
from handey_studio.modeling.suggesting.outlines import Line, lines_of, on_plane, polygon_of, regular
from handey_studio.modeling.suggesting.planes import BodyPlane
from handey_studio.modeling.suggesting.shapes import ALONG, Shape, basis_of, plane_with, solid_of

INTO_M = 0.001  # columns reach into higher ones beside them
NEAR_STEP_M = 0.006  # so near to where a higher face hides the lower one its side goes down
EXACT_DIGITS = 7  # a ten thousandth of a millimetre


def columns(body: Body, upward: Sequence[Clue], planes: Sequence[BodyPlane], upright: NDArray, short: float) -> Shape:
    """All that stands below the faces that look up, down to the support. `upright` (3, 3): rows are directions in which sides are made
    exact, so that those on one plane become one face, the third up."""
    option = f"columns under {len(upward)} faces"
    made = manifold3d.Manifold()
    for cap in upward:
        lines = regular(_stepped(body, cap, lines_of(body, cap, 0, planes, basis_of(cap.normal)), planes), short)
        if any(line.cut for line in lines):
            return Shape(
                option, None, f"face {cap.of[1] + 1} is cut off by a nearer thing", max(x.length for x in lines if x.cut), 0.0, "m"
            )
        polygon = polygon_of([lines])
        if polygon is None:
            return Shape(option, None, f"the outline of face {cap.of[1] + 1} has no simple polygon")
        made = made + _column(polygon, cap, plane_with(planes, cap.of), upright)
    try:
        solid = solid_of(made)
    except BadInput as error:
        return Shape(option, None, str(error).rstrip("."))
    return Shape(option, Polyhedron(solid.vertices @ upright, solid.faces))


def upright_of(frame: NDArray) -> NDArray:
    """The frame's level directions and up, as rows; those of the world where it is tilted."""
    if abs(frame[2] @ UP) < ALONG:
        return np.eye(3)
    return np.stack([frame[0], np.cross(UP, frame[0]), UP])


def _stepped(body: Body, cap: Clue, lines: list[Line], planes: Sequence[BodyPlane]) -> list[Line]:
    """Sides where a higher face of the same object hides nothing more than a step: they reach a little into what is below that."""
    basis, level = basis_of(cap.normal), plane_with(planes, cap.of).offset
    rising = {c.a + c.b - cap.of[1] for c in body.patches[cap.of[0]].creases if cap.of[1] in (c.a, c.b) and not c.convex}
    own = {patch for scan, patches in body.members if scan == cap.of[0] for patch in patches}
    out = []
    for line, border in zip(lines, body.patch(cap.of).borders[0], strict=False):
        if border.other in own and (border.kind == "cut" or (border.kind == "crease" and border.other in rising)):
            facing = [p for p in planes if p.normal @ basis[:, :2] @ line.outward < -0.97 and abs(p.offset + line.offset) < NEAR_STEP_M]
            outward, offset = line.outward, line.offset
            if facing:
                nearest = min(facing, key=lambda p: abs(p.offset + line.offset))
                outward, offset = on_plane(nearest, basis, level, outward, offset)
            line = line._replace(outward=outward, offset=offset + INTO_M, cut=False)
        out.append(line)
    return out


def _column(polygon: shapely.Polygon, cap: Clue, top: BodyPlane, upright: NDArray) -> manifold3d.Manifold:
    """What lies straight below a polygon of the cap's plane, down to z = 0, in the directions `upright`."""
    basis = basis_of(cap.normal)
    corners = np.asarray(polygon.exterior.coords)[:-1]
    points = np.round(np.c_[corners, np.full(len(corners), top.offset)] @ basis.T @ upright.T, EXACT_DIGITS)
    high = float(points[:, 2].max()) + 1.0
    block = manifold3d.Manifold.extrude(manifold3d.CrossSection([points[:, :2].copy()]), high)
    return block.trim_by_plane(tuple(-upright @ cap.normal), -top.offset)
