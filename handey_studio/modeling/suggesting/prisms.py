"""A face that is seen, extruded back to where the object may end."""

from collections.abc import Iterator, Sequence

import manifold3d
import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron, prism
from handey_studio.geometry.transforms import apply, transform
from handey_studio.modeling.suggesting.clues import Body, Clue
from handey_studio.modeling.suggesting.mirrored import mirrored
from handey_studio.modeling.suggesting.outlines import Line, lines_of, polygon_of, regular
from handey_studio.modeling.suggesting.planes import BodyPlane
from handey_studio.modeling.suggesting.shapes import ALONG, LEAST_THICK_M, MOST_ENDS, Shape, basis_of, plane_with, solid_of, worth_of


def prisms(body: Body, cap: Clue, planes: Sequence[BodyPlane], short: float) -> Iterator[Shape]:
    """A seen face extruded back to each plane where the object may end."""
    option = f"face {cap.of[1] + 1} of scan {cap.of[0] + 1}"
    top = plane_with(planes, cap.of)
    ends = [plane for plane in planes if plane.normal @ cap.normal < -ALONG and top.offset + plane.offset > LEAST_THICK_M]
    if not ends:
        yield Shape(f"{option} extruded", None, "nothing shows how far it reaches back")
        return
    basis = basis_of(cap.normal)
    rings = [regular(lines_of(body, cap, ring, planes, basis), short) for ring in range(len(body.patch(cap.of).rings))]
    for end in sorted(ends, key=worth_of, reverse=True)[:MOST_ENDS]:
        depth = top.offset + end.offset
        extruded = f"{option} extruded by {1e3 * depth:.1f} mm"
        cut = max((line.length for line in rings[0] if line.cut), default=0.0)
        if not cut:
            yield _extruded(extruded, rings, basis, top.offset, depth)
            continue
        yield Shape(extruded, None, "the face is cut off by a nearer thing", cut, 0.0, "m")
        for whole in mirrored(rings[0], short):
            yield _extruded(f"{extruded} and completed by its mirror image", [whole, *rings[1:]], basis, top.offset, depth, "symmetric")


def _extruded(option: str, rings: list[list[Line]], basis: NDArray, offset: float, depth: float, by: str = "hidden") -> Shape:
    polygon = polygon_of(rings)
    if polygon is None:
        return Shape(option, None, "its outline has no simple polygon")
    try:
        solid = prism_of(polygon, depth)
    except BadInput as error:
        return Shape(option, None, str(error).rstrip("."))
    T = transform(basis, basis[:, 2] * (offset - depth))
    return Shape(option, Polyhedron(apply(T, solid.vertices), solid.faces), by=by)


def prism_of(polygon: shapely.Polygon, height: float) -> Polyhedron:
    """A polygon with holes extruded from z = 0 [m]."""
    loops = [np.asarray(ring.coords)[:-1] for ring in (polygon.exterior, *polygon.interiors)]
    if len(loops) == 1:
        return prism(loops[0], height)
    section = manifold3d.CrossSection([np.array(loops[0])])
    for hole in loops[1:]:
        section = section - manifold3d.CrossSection([np.array(hole[::-1])])
    return solid_of(manifold3d.Manifold.extrude(section, height))
