"""Polyhedra with true polygon faces: corners, faces with holes, edges and their dihedral angles."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from handey_studio.base import Value, frozen_array


@dataclass(frozen=True)
class Face:
    """A planar polygon: the outer loop counter-clockwise seen from outside, holes clockwise, as corner numbers."""

    outer: tuple[int, ...]
    holes: tuple[tuple[int, ...], ...] = ()

    @property
    def loops(self) -> tuple[tuple[int, ...], ...]:
        return (self.outer, *self.holes)


@dataclass(frozen=True)
class Edge:
    """The line between two corners and the two faces that meet there.

    `dihedral` [rad] is the angle that the surface turns by, in (0, π): positive on convex edges, negative on concave
    ones. The edge runs from `start` to `end` counter-clockwise around `left`.
    """

    start: int
    end: int
    left: int
    right: int
    dihedral: float


@dataclass(frozen=True, eq=False)
class Polyhedron(Value):
    """A closed solid bounded by planar polygons. `vertices` (n, 3) [m] in the part's frame."""

    vertices: NDArray
    faces: tuple[Face, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen_array(self.vertices))

    @cached_property
    def normals(self) -> NDArray:
        """Outward unit normals of the faces (m, 3)."""
        vectors = np.array([area_vector(self.vertices[list(face.outer)]) for face in self.faces])
        return frozen_array(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))

    @cached_property
    def offsets(self) -> NDArray:
        """Plane offsets (m,) [m]: `normal · x = offset` on each face."""
        return frozen_array([n @ self.vertices[face.outer[0]] for n, face in zip(self.normals, self.faces, strict=True)])

    @cached_property
    def edges(self) -> tuple[Edge, ...]:
        """Every edge once, each with the two faces that meet there."""
        owner = {(a, b): f for f, face in enumerate(self.faces) for loop in face.loops for a, b in _sides(loop)}
        return tuple(
            Edge(a, b, f, owner[b, a], self._dihedral(a, b, f, owner[b, a])) for (a, b), f in owner.items() if a < b and (b, a) in owner
        )

    @cached_property
    def triangles(self) -> NDArray:
        """Corner numbers of a triangulation (k, 3), outward, without new corners."""
        return frozen_array(np.concatenate(self._triangles_by_face), int)

    @cached_property
    def face_of_triangle(self) -> NDArray:
        """The face (k,) that each of the triangles belongs to."""
        return frozen_array(np.repeat(np.arange(len(self.faces)), [len(rows) for rows in self._triangles_by_face]), int)

    @cached_property
    def _triangles_by_face(self) -> list[NDArray]:
        return [self.face_triangles(f) for f in range(len(self.faces))]

    @cached_property
    def diameter(self) -> float:
        """Greatest distance between two corners [m]."""
        return float(np.linalg.norm(self.vertices[:, None] - self.vertices[None], axis=2).max())

    @cached_property
    def volume_and_centroid(self) -> tuple[float, NDArray]:
        """Volume [m³] and its centroid (3,) [m]."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
        total = float(volumes.sum())
        return total, frozen_array((volumes[:, None] * (a + b + c) / 4.0).sum(axis=0) / total)

    def face_frame(self, f: int) -> NDArray:
        """T_part_face (4, 4): origin on the face, z outward along its normal, x along its first side."""
        corners = self.vertices[list(self.faces[f].outer)]
        x = corners[1] - corners[0]
        x = x / np.linalg.norm(x)
        z = self.normals[f]
        T = np.eye(4)
        T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3] = x, np.cross(z, x), z, corners[0]
        return T

    def face_polygon(self, f: int, T_part_plane: NDArray) -> shapely.Polygon:
        """The face's outline and holes in the x, y [m] of a plane frame parallel to it."""
        rings = [((self.vertices[list(loop)] - T_part_plane[:3, 3]) @ T_part_plane[:3, :2]) for loop in self.faces[f].loops]
        return shapely.Polygon(rings[0], rings[1:])

    def face_triangles(self, f: int) -> NDArray:
        """Corner numbers of the triangles of face f (k, 3)."""
        loop = self.faces[f].outer
        if len(loop) == 3 and not self.faces[f].holes:
            return np.array([loop])
        numbers = [number for loop in self.faces[f].loops for number in loop]
        T = self.face_frame(f)
        flat = (self.vertices[numbers] - T[:3, 3]) @ T[:3, :2]
        triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(self.face_polygon(f, T)))
        rows = []
        for triangle in triangles:
            corners = shapely.get_coordinates(triangle)[:3]
            picked = [int(np.argmin(((flat - corner) ** 2).sum(axis=1))) for corner in corners]
            sides = flat[picked[1:]] - flat[picked[0]]
            turn = sides[0, 0] * sides[1, 1] - sides[0, 1] * sides[1, 0]
            rows.append([numbers[p] for p in (picked if turn > 0 else picked[::-1])])
        return np.array(rows)

    def _dihedral(self, a: int, b: int, left: int, right: int) -> float:
        n_left, n_right = self.normals[left], self.normals[right]
        along = self.vertices[b] - self.vertices[a]
        turn = np.cross(n_left, n_right) @ along / np.linalg.norm(along)
        return float(np.arctan2(turn, n_left @ n_right))


def box(size: ArrayLike) -> Polyhedron:
    """A cuboid of the given size (3,) [m], centred on the origin."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * np.asarray(size, dtype=float)
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return Polyhedron(corners, tuple(Face(side) for side in sides))


def area_vector(corners: NDArray) -> NDArray:
    """Newell's area vector of a planar loop (n, 3): along its normal, twice its area long."""
    return np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)


def _sides(loop: tuple[int, ...]) -> list[tuple[int, int]]:
    return list(zip(loop, loop[1:] + loop[:1], strict=True))
