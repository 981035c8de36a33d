"""Solids by the planes of their faces: corners put where planes meet, faces followed through a change, the surface made sound again.

Faces are exactly planar because every corner is computed from the planes that meet there, never the other way round.
"""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from handey_studio.base import BadInput, measured
from handey_studio.geometry import Face, Polyhedron, polyhedron_from_polygons

SAME_M = 1e-6  # corners this near are one corner, faces this near to a plane are in it
FLAT_M = 2e-6
SAME_DIRECTION = 0.9999
DEPENDENT = 1e-6  # planes whose normals are this near to dependent have no corner of their own

Label = TypeVar("Label")


def corners_on_planes(solid: Polyhedron, normals: NDArray, offsets: NDArray) -> NDArray:
    """Corners (n, 3) [m] of a solid when its faces lie in the planes `normals` (m, 3) · x = `offsets` (m,) [m].

    Each corner is where the planes of its faces meet, moved no farther than they ask. Raises BadInput where more than three faces meet
    and would no longer do so in one point.
    """
    meeting = faces_at_corners(solid)
    corners = np.array(solid.vertices)
    apart = np.zeros(len(corners))
    for v, faces in enumerate(meeting):
        N, d = normals[faces], offsets[faces]
        corners[v] += np.linalg.pinv(N, rcond=DEPENDENT) @ (d - N @ corners[v])
        apart[v] = np.abs(N @ corners[v] - d).max()
    if apart.max() > SAME_M:
        v = int(np.argmax(apart))
        raise BadInput(
            f"the {len(meeting[v])} faces that meet at the corner {told_point(solid.vertices[v])} would come apart there by "
            f"{measured(float(apart[v]), 'm')}; move them together, or cut and join instead."
        )
    return corners


def faces_at_corners(solid: Polyhedron) -> list[list[int]]:
    """The faces that meet at each corner."""
    meeting: list[list[int]] = [[] for _ in solid.vertices]
    for f, face in enumerate(solid.faces):
        for corner in {c for loop in face.loops for c in loop}:
            meeting[corner].append(f)
    return meeting


def sound(vertices: NDArray, faces: Sequence[Face]) -> Polyhedron:
    """A closed solid with planar faces from corners (n, 3) [m] and faces of which some may have shrunk to nothing.

    Coinciding corners are welded and coplanar neighbours merged. Raises BadInput with one sentence when no sound solid is left.
    """
    number = _welded(vertices)
    polygons: list[list[int]] = []
    for face in faces:
        loops = [_without_repeats([int(number[c]) for c in loop]) for loop in face.loops]
        if len(loops[0]) >= 3:
            polygons += _polygons(vertices, Face(tuple(loops[0]), tuple(tuple(loop) for loop in loops[1:] if len(loop) >= 3)))
    if len(polygons) < 4:
        raise BadInput("nothing would be left of the solid; it must keep its thickness.")
    return flat(polyhedron_from_polygons(vertices, polygons))


def flat(solid: Polyhedron) -> Polyhedron:
    """The solid, if its faces are planar; neighbours that all but lie in one plane are taken for one face, which then is bent."""
    for f, face in enumerate(solid.faces):
        corners = solid.vertices[[c for loop in face.loops for c in loop]]
        off = np.abs(corners @ solid.normals[f] - solid.offsets[f]).max()
        if off > FLAT_M:
            raise BadInput(
                f"two faces at {told_point(corners.mean(axis=0))} would lie within 0.2° of one plane, {measured(float(off), 'm')} apart; "
                "make them one face or turn them farther."
            )
    return solid


def onto_planes(solid: Polyhedron, normals: NDArray, offsets: NDArray) -> Polyhedron:
    """The solid with each face put exactly into the one of the planes, (k, 3) and (k,) [m], that it lies in but for rounding."""
    exact_normals, exact_offsets = np.array(solid.normals), np.array(solid.offsets)
    for f in range(len(solid.faces)):
        k, sign, off = nearest_plane(solid, f, normals, offsets)
        if off < SAME_M:
            exact_normals[f], exact_offsets[f] = sign * normals[k], sign * offsets[k]
    return Polyhedron(corners_on_planes(solid, exact_normals, exact_offsets), solid.faces)


def nearest_plane(solid: Polyhedron, f: int, normals: NDArray, offsets: NDArray) -> tuple[int, float, float]:
    """Which plane, either way round, a face lies nearest to: its number, 1 or −1, and the greatest distance of a corner [m]."""
    corners = solid.vertices[list(solid.faces[f].outer)]
    off = np.abs(corners @ normals.T - offsets).max(axis=0)
    turned = normals @ solid.normals[f]
    off[np.abs(turned) < SAME_DIRECTION] = np.inf
    k = int(np.argmin(off))
    return k, float(np.sign(turned[k])), float(off[k])


def inherited(solid: Polyhedron, parents: Sequence[tuple[Polyhedron, Sequence[Label]]], otherwise: Label) -> tuple[Label, ...]:
    """For each face of a solid the label of the parent's face that it is a piece of, the first parent first; else `otherwise`."""
    return tuple(_label_of(solid, f, parents, otherwise) for f in range(len(solid.faces)))


def shrunk(corners: NDArray) -> bool:
    """Whether an outline (n, 3) [m] has shrunk to a line or a point."""
    area = 0.5 * np.linalg.norm(np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0))
    return bool(area <= SAME_M * np.ptp(corners, axis=0).max())


def told_point(point: NDArray) -> str:
    """A place in mm, as it is read on screen."""
    return f"({', '.join(f'{1e3 * x + 0.0:.1f}' for x in np.round(point, 4))}) mm"


def _label_of(solid: Polyhedron, f: int, parents: Sequence[tuple[Polyhedron, Sequence[Label]]], otherwise: Label) -> Label:
    T = solid.face_frame(f)
    inside = shapely.Point(*shapely.get_coordinates(solid.face_polygon(f, T).representative_point())[0])
    point = T[:3, 3] + T[:3, :2] @ (inside.x, inside.y)
    for parent, labels in parents:
        close = np.abs(parent.normals @ point - parent.offsets) < SAME_M
        for g in np.flatnonzero(close & (np.abs(parent.normals @ solid.normals[f]) > SAME_DIRECTION)):
            if parent.face_polygon(int(g), T).buffer(SAME_M).contains(inside):
                return labels[int(g)]
    return otherwise


def _welded(vertices: NDArray) -> NDArray:
    """For each corner the number of the one that stands for all that coincide with it."""
    near = np.linalg.norm(vertices[:, None] - vertices[None], axis=2) < SAME_M
    _, group = connected_components(coo_array(near), directed=False)
    first = np.full(group.max() + 1, len(vertices))
    np.minimum.at(first, group, np.arange(len(vertices)))
    return first[group]


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
    if not alone.face_polygon(0, alone.face_frame(0)).is_valid:
        raise BadInput(f"the outline of the face at {told_point(corners.mean(axis=0))} would cross itself.")
    return alone.face_triangles(0).tolist() if face.holes else [list(face.outer)]


def _flat_fan(vertices: NDArray, loop: tuple[int, ...]) -> list[list[int]]:
    """Triangles without area of a face that has shrunk to a line: they join what lies on its two sides."""
    along = vertices[list(loop)] @ np.linalg.svd(vertices[list(loop)] - vertices[loop[0]])[2][0]
    first = int(np.argmin(along))
    turned = loop[first:] + loop[:first]
    return [[turned[0], turned[k], turned[k + 1]] for k in range(1, len(turned) - 1)]
