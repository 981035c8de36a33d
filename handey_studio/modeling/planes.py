"""Solids by the planes of their faces: corners put where planes meet, faces followed through a change.

Faces are exactly planar because every corner is computed from the planes that meet there, never the other way round.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, measured
from handey_studio.geometry import Polyhedron

SAME_M = 1e-6  # corners this near are one corner, faces this near to a plane are in it
SAME_DIRECTION = 0.9999
THIN_M = 1e-9  # the normal of a triangle less high than this means nothing
DEPENDENT = 1e-6  # planes whose normals are this near to dependent have no corner of their own

Label = TypeVar("Label")


@dataclass(frozen=True, eq=False)
class Change(Value):
    """An edited solid, and for each of its faces the number of the face that it was before."""

    solid: Polyhedron
    came_from: tuple[int, ...]


def corners_on_planes(solid: Polyhedron, normals: NDArray, offsets: NDArray) -> NDArray:
    """Corners (n, 3) [m] of a solid when its faces lie in the planes `normals` (m, 3) · x = `offsets` (m,) [m].

    Each corner is where the planes of its faces meet, moved no farther than they ask. Raises BadInput where more than three faces meet
    and would no longer do so in one point.
    """
    meeting = faces_at_corners(solid)
    corners, apart = where_planes_meet(solid.vertices, meeting, normals, offsets)
    if apart.max() > SAME_M:
        v = int(np.argmax(apart))
        raise BadInput(
            f"the {len(meeting[v])} faces that meet at the corner {told_point(solid.vertices[v])} would come apart there by "
            f"{measured(float(apart[v]), 'm')}; move them together, or cut and join instead."
        )
    return corners


def where_planes_meet(points: NDArray, meeting: Sequence[Sequence[int]], normals: NDArray, offsets: NDArray) -> tuple[NDArray, NDArray]:
    """Points (n, 3) [m] moved as little as it takes to be in the planes `meeting` there, and how far (n,) [m] they still are from one."""
    here = np.full((len(meeting), max(1, *map(len, meeting))), -1)
    for v, planes in enumerate(meeting):
        here[v, : len(planes)] = planes
    N = np.where((here >= 0)[..., None], normals[here], 0.0)  # rows of zeros ask for nothing
    d = np.where(here >= 0, offsets[here], 0.0)
    short = d - np.einsum("vfi,vi->vf", N, points)
    moved = points + np.einsum("vif,vf->vi", np.linalg.pinv(N, rcond=DEPENDENT), short)
    return moved, np.abs(np.einsum("vfi,vi->vf", N, moved) - d).max(axis=1)


def faces_at_corners(solid: Polyhedron) -> list[list[int]]:
    """The faces that meet at each corner."""
    meeting: list[list[int]] = [[] for _ in solid.vertices]
    for f, face in enumerate(solid.faces):
        for corner in {c for loop in face.loops for c in loop}:
            meeting[corner].append(f)
    return meeting


def onto_planes(vertices: NDArray, triangles: NDArray, normals: NDArray, offsets: NDArray, within: float) -> NDArray:
    """Corners (n, 3) [m] of a mesh put exactly where those of the planes, (k, 3) and (k,) [m], meet that its triangles lie in but for
    `within` [m]; a corner where these do not meet stays."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    area = np.linalg.norm(across, axis=1, keepdims=True)
    thin = area[:, 0] < THIN_M * np.linalg.norm(np.stack([b - a, c - b, a - c]), axis=2).max(axis=0)
    turned = np.abs(across @ normals.T) / np.maximum(area, 1e-300)
    off = np.abs(vertices @ normals.T - offsets)[triangles].max(axis=1)
    off[(turned < SAME_DIRECTION) | thin[:, None]] = np.inf
    plane = np.argmin(off, axis=1)
    found = off[np.arange(len(plane)), plane] < within
    meeting: list[set[int]] = [set() for _ in vertices]
    for triangle, k in zip(triangles[found], plane[found], strict=True):
        for corner in triangle:
            meeting[corner].add(int(k))
    exact, apart = where_planes_meet(vertices, [sorted(planes) for planes in meeting], normals, offsets)
    return np.where((apart < SAME_M)[:, None], exact, vertices)


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
