"""Solids made sound: corners welded, neighbours in one plane merged; and what is no single solid body without slivers refused."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from handey_studio.base import BadInput, measured
from handey_studio.geometry import Face, Polyhedron, polyhedron_from_polygons
from handey_studio.geometry.meshes import standing_for
from handey_studio.geometry.soundness import crossings
from handey_studio.modeling.planes import SAME_M, told_point

FLAT_M = 2e-6
ONE_PLANE = np.cos(np.deg2rad(0.21))  # a little more than where the polyhedron makes two neighbours one face
FOLDED = -ONE_PLANE
SLIVER_M = 1e-4  # narrower than a tenth of a millimetre is a slip of the hand, and no sensor sees it


def sound(vertices: NDArray, faces: Sequence[Face]) -> Polyhedron:
    """A closed solid with planar faces from corners (n, 3) [m] and faces of which some may have shrunk to nothing.

    Coinciding corners are welded and coplanar neighbours merged. Raises BadInput with one sentence when no sound solid is left.
    """
    number = standing_for(vertices, SAME_M)
    polygons: list[list[int]] = []
    for face in faces:
        loops = [_without_repeats([int(number[c]) for c in loop]) for loop in face.loops]
        if len(loops[0]) >= 3:
            polygons += _polygons(vertices, Face(tuple(loops[0]), tuple(tuple(loop) for loop in loops[1:] if len(loop) >= 3)))
    if len(polygons) < 4:
        raise BadInput("nothing would be left of the solid; it must keep its thickness.")
    return checked(polyhedron_from_polygons(vertices, polygons))


def with_same_faces(solid: Polyhedron, vertices: NDArray) -> Polyhedron | None:
    """The solid with other corners (n, 3) [m], planar as they are; None when some coincide, a face has shrunk, or neighbours are now one.

    Raises BadInput with one sentence when the surface would pass through itself.
    """
    if (standing_for(vertices, SAME_M) != np.arange(len(vertices))).any():
        return None
    changed = Polyhedron(vertices, solid.faces)
    if any(shrunk(vertices[list(face.outer)]) for face in solid.faces):
        return None
    if any(changed.normals[edge.left] @ changed.normals[edge.right] > ONE_PLANE for edge in solid.edges):
        return None
    for f in range(len(changed.faces)):
        _check_outline(changed, f)
    places = crossings(changed.vertices, changed.triangles)[0]
    if len(places):
        raise BadInput(f"the surface would pass through itself at {told_point(places[0])}.")
    return checked(changed)


def checked(solid: Polyhedron) -> Polyhedron:
    """The solid, if its faces are planar and it is one body that touches itself nowhere. Raises BadInput with one sentence."""
    _check_flat(solid)
    for edge in solid.edges:
        if solid.normals[edge.left] @ solid.normals[edge.right] < FOLDED:
            raise BadInput(f"the solid would have a fin of no thickness at {told_point(solid.vertices[edge.start])}; go farther.")
    sides = [(a, b, f) for f, face in enumerate(solid.faces) for loop in face.loops for a, b in zip(loop, loop[1:] + loop[:1], strict=True)]
    number = {(a, b): k for k, (a, b, _) in enumerate(sides)}
    owner = {(a, b): f for a, b, f in sides}
    bodies = _groups([(f, owner[b, a]) for a, b, f in sides], len(solid.faces))
    if bodies > 1:
        raise BadInput("the solid would be two bodies that touch at a corner or an edge at most; a part is one body.")
    around = [
        (number[b, c], number[b, a])
        for face in solid.faces
        for loop in face.loops
        for a, b, c in zip(loop, loop[1:] + loop[:1], loop[2:] + loop[:2], strict=True)
    ]
    if _groups(around, len(sides)) > len(solid.vertices):
        raise BadInput("the solid would touch itself at a corner; move it apart there, or join it over more than a point.")
    _check_no_corner_on_an_edge(solid)
    return solid


def without_slivers(solid: Polyhedron, what: str, *before: Polyhedron) -> Polyhedron:
    """The solid, if it has no sliver that the solids `before` did not have. Raises BadInput that names `what` would leave it."""
    width, where = narrowest(solid)
    if width < (1.0 - 1e-6) * min(SLIVER_M, *(narrowest(one)[0] for one in before)):
        raise BadInput(
            f"{what} would leave a sliver {measured(width, 'm')} wide at {told_point(where)}; meet the next face or keep clear of it."
        )
    return solid


def narrowest(solid: Polyhedron) -> tuple[float, NDArray]:
    """The width [m] of a solid's narrowest face or the length of its shortest edge, whichever is less, and where (3,) [m]."""
    best, where = np.inf, solid.vertices[0]
    for face, normal in zip(solid.faces, solid.normals, strict=True):
        rings = [solid.vertices[list(loop)] for loop in face.loops]
        area = sum(float(normal @ np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0)) for ring in rings)
        for corners in rings:
            sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
            width = min(float(sides.min()), area / float(sides.max()))
            if width < best:
                best, where = width, corners[int(np.argmin(sides))]
    return best, where


def shrunk(corners: NDArray) -> bool:
    """Whether an outline (n, 3) [m] has shrunk to a line or a point."""
    area = 0.5 * np.linalg.norm(np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0))
    return bool(area <= SAME_M * np.ptp(corners, axis=0).max())


def _check_flat(solid: Polyhedron) -> None:
    for f, face in enumerate(solid.faces):
        corners = solid.vertices[[c for loop in face.loops for c in loop]]
        off = np.abs(corners @ solid.normals[f] - solid.offsets[f]).max()
        if off > FLAT_M:
            raise BadInput(
                f"two faces at {told_point(corners.mean(axis=0))} would lie within 0.2° of one plane, {measured(float(off), 'm')} apart; "
                "make them one face or turn them farther."
            )


def _check_no_corner_on_an_edge(solid: Polyhedron) -> None:
    starts, ends = (solid.vertices[[getattr(edge, end) for edge in solid.edges]] for end in ("start", "end"))
    ways = ends - starts
    lengths = np.linalg.norm(ways, axis=1)
    along = np.einsum("vei,ei->ve", solid.vertices[:, None] - starts, ways) / lengths
    off = np.linalg.norm(solid.vertices[:, None] - starts - along[..., None] * (ways / lengths[:, None]), axis=2)
    touching = (off < SAME_M) & (along > SAME_M) & (along < lengths - SAME_M)
    if touching.any():
        at = told_point(solid.vertices[int(np.argmax(touching.any(axis=1)))])
        raise BadInput(f"the solid would touch itself at the corner {at}; move it apart there, or join it over more than a point.")


def _check_outline(solid: Polyhedron, f: int) -> None:
    if not solid.face_polygon(f, solid.face_frame(f)).is_valid:
        middle = solid.vertices[list(solid.faces[f].outer)].mean(axis=0)
        raise BadInput(f"the outline of the face at {told_point(middle)} would cross itself.")


def _groups(pairs: list[tuple[int, int]], count: int) -> int:
    """How many groups of things 0 … count − 1 the pairs leave unconnected."""
    rows, columns = np.array(pairs).T
    return int(connected_components(coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count)), directed=False)[0])


def _without_repeats(loop: list[int]) -> list[int]:
    """A loop without corners that follow themselves, and without spikes that go out and come back."""
    kept = [c for k, c in enumerate(loop) if c != loop[k - 1]]
    for k in range(len(kept)):
        if len(kept) >= 3 and kept[k - 1] == kept[(k + 1) % len(kept)]:
            return _without_repeats([c for i, c in enumerate(kept) if i != k])
    return kept if len(set(kept)) >= 3 else []


def _polygons(vertices: NDArray, face: Face) -> list[list[int]]:
    """A face as polygons without holes. Raises BadInput when its outline crosses itself."""
    corners = vertices[list(face.outer)]
    if shrunk(corners):
        return _flat_fan(vertices, face.outer)
    alone = Polyhedron(vertices, (face,))
    _check_outline(alone, 0)
    return alone.face_triangles(0).tolist() if face.holes else [list(face.outer)]


def _flat_fan(vertices: NDArray, loop: tuple[int, ...]) -> list[list[int]]:
    """Triangles without area of a face that has shrunk to a line: they join what lies on its two sides."""
    along = vertices[list(loop)] @ np.linalg.svd(vertices[list(loop)] - vertices[loop[0]])[2][0]
    first = int(np.argmin(along))
    turned = loop[first:] + loop[:first]
    return [[turned[0], turned[k], turned[k + 1]] for k in range(1, len(turned) - 1)]
