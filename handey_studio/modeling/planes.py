"""Solids by the planes of their faces: corners put where planes meet, faces followed through a change.

Faces are exactly planar because every corner is computed from the planes that meet there, never the other way round.
"""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.base import BadInput, measured
from handey_studio.geometry import Polyhedron

SAME_M = 1e-6  # corners this near are one corner, faces this near to a plane are in it
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
