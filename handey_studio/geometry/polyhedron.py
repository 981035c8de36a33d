"""Polyhedra with true polygon faces: corners, faces with holes, edges and their dihedral angles."""

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.geometry.soundness import crossings, unmatched_sides

WELD_M = 1e-6  # corners closer than this are one corner: far below any part's tolerance, above STL's float32 rounding
COPLANAR_RAD = np.deg2rad(0.2)  # neighbouring triangles within this angle are one face
MAX_TRIANGLES = 5000  # more than this is a scan or a rounded shape, not a polyhedral part


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
        vectors = np.array([_area_vector(self.vertices[list(face.outer)]) for face in self.faces])
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


def polyhedron_from_polygons(vertices: ArrayLike, polygons: list[list[int]]) -> Polyhedron:
    """A validated polyhedron from corners (n, 3) [m] and polygons (corner numbers, outward).

    Corners that coincide are welded, coplanar neighbours merged into one face (so faces may get holes), and corners in
    the middle of a straight edge dropped. Raises BadInput with one sentence when the surface is not a closed solid.
    """
    corners = np.asarray(vertices, dtype=float).reshape(-1, 3)
    if not np.isfinite(corners).all():
        raise BadInput("a corner is not a finite number; every coordinate must be finite metres.")
    triangles = triangles_of(corners, polygons)
    if len(triangles) > MAX_TRIANGLES:
        raise BadInput(f"it has {len(triangles)} triangles, the limit for a polyhedral part is {MAX_TRIANGLES}; simplify the mesh.")
    corners, triangles = welded(corners, triangles)
    check_closed(triangles)
    if np.einsum("ij,ij->i", corners[triangles[:, 0]], np.cross(corners[triangles[:, 1]], corners[triangles[:, 2]])).sum() < 0:
        triangles = triangles[:, ::-1]
    _check_no_self_intersection(corners, triangles)
    faces = _drop_straight_corners(corners, _merge_coplanar(corners, triangles))
    if any(len(loop) < 3 for face in faces for loop in face.loops):
        raise BadInput("a face has shrunk to a line; remove slivers from the surface.")
    solid = _compact(corners, faces)
    try:
        volume = solid.volume_and_centroid[0]
    except shapely.errors.GEOSException:
        raise BadInput("a face is folded, or too narrow to be cut into triangles; remove slivers from the surface.") from None
    if volume < 1e-12:
        raise BadInput(f"its volume is {volume * 1e9:.3g} mm³; a part must be a solid.")
    return solid


def box(size: ArrayLike) -> Polyhedron:
    """A cuboid of the given size (3,) [m], centred on the origin."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * np.asarray(size, dtype=float)
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return Polyhedron(corners, tuple(Face(side) for side in sides))


def prism(outline: ArrayLike, height: float) -> Polyhedron:
    """An outline (n, 2) [m], counter-clockwise, extruded from z = 0 to `height` [m]."""
    outline = np.asarray(outline, dtype=float)
    n = len(outline)
    corners = np.concatenate([np.c_[outline, np.zeros(n)], np.c_[outline, np.full(n, height)]])
    sides = [[i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n)]
    return polyhedron_from_polygons(corners, [list(range(n))[::-1], list(range(n, 2 * n)), *sides])


def _area_vector(corners: NDArray) -> NDArray:
    """Newell's area vector of a planar loop (n, 3): along its normal, twice its area long."""
    return np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)


def _sides(loop: tuple[int, ...]) -> list[tuple[int, int]]:
    return list(zip(loop, loop[1:] + loop[:1], strict=True))


def triangles_of(corners: NDArray, polygons: list[list[int]]) -> NDArray:
    """Triangles (t, 3) of polygons over corners (n, 3) [m]; polygons may be concave. Raises BadInput for one that is none."""
    if all(len(polygon) == 3 for polygon in polygons):
        triangles = np.array(polygons, dtype=int).reshape(-1, 3)
        if not len(triangles) or (triangles.min() >= 0 and triangles.max() < len(corners)):
            return triangles
    return np.array([t for polygon in polygons for t in _fan(corners, polygon)], dtype=int).reshape(-1, 3)


def _fan(corners: NDArray, polygon: list[int]) -> NDArray:
    """Triangles of one polygon of a file, which may be concave."""
    if len(polygon) < 3 or min(polygon) < 0 or max(polygon) >= len(corners):
        raise BadInput(f"a face lists corners {polygon}; it needs at least 3 of the {len(corners)} corners.")
    if len(polygon) == 3:
        return np.array([polygon])
    moved = (corners[polygon] != corners[np.roll(polygon, 1)]).any(axis=1)
    polygon = [corner for corner, other in zip(polygon, moved, strict=True) if other]
    if len(polygon) < 3:
        raise BadInput("a face has no area; remove it or move its corners apart.")
    points = corners[polygon]
    area = _area_vector(points)
    length = np.linalg.norm(area)
    if length == 0:
        raise BadInput("a face has no area; remove it or move its corners apart.")
    distances = (points - points.mean(axis=0)) @ (area / length)
    scale = np.linalg.norm(np.ptp(points, axis=0))
    if np.abs(distances).max() > 1e-3 * scale:
        raise BadInput(f"a face is bent by {np.abs(distances).max() * 1e3:.3g} mm; a face must be planar within {scale:.3g} mm.")
    local = Polyhedron(points, (Face(tuple(range(len(polygon)))),))
    if not local.face_polygon(0, local.face_frame(0)).is_valid:
        raise BadInput("a face's outline crosses itself; each face must be a simple polygon.")
    return np.asarray(polygon)[local.face_triangles(0)]


def welded(corners: NDArray, triangles: NDArray) -> tuple[NDArray, NDArray]:
    """Coinciding corners made one, triangles without area dropped."""
    _, first, inverse = np.unique(np.round(corners / WELD_M).astype(np.int64), axis=0, return_index=True, return_inverse=True)
    triangles = inverse.reshape(-1)[triangles]
    corners = corners[first]
    distinct = (triangles[:, 0] != triangles[:, 1]) & (triangles[:, 1] != triangles[:, 2]) & (triangles[:, 2] != triangles[:, 0])
    return corners, triangles[distinct]


def check_closed(triangles: NDArray) -> None:
    """Every directed side must meet its opposite exactly once."""
    if len(triangles) < 4:
        raise BadInput(f"it has {len(triangles)} triangles; a solid needs at least 4.")
    alone, doubled = unmatched_sides(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]))
    if len(alone):
        raise BadInput(f"its surface has holes: {len(alone)} sides have no neighbour; close the surface.")
    if len(doubled):
        raise BadInput(f"{len(doubled)} sides are shared by more than two faces, or faces point both ways; make it one solid.")


def _check_no_self_intersection(corners: NDArray, triangles: NDArray) -> None:
    """No edge may pass through the inside of a triangle that it does not touch."""
    places = len(crossings(corners, triangles)[0])
    if places:
        raise BadInput(f"its surface passes through itself at {places} places; a part must not intersect itself.")


def _merge_coplanar(corners: NDArray, triangles: NDArray) -> list[Face]:
    """Faces made of neighbouring coplanar triangles."""
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(areas, 1e-30)[:, None]
    owner = {(int(t[k]), int(t[(k + 1) % 3])): i for i, t in enumerate(triangles) for k in range(3)}
    pairs = [(i, owner[q, p]) for (p, q), i in owner.items() if _coplanar(normals, areas, i, owner[q, p])]
    rows, cols = np.array(pairs, dtype=int).reshape(-1, 2).T
    _, group = connected_components(coo_array((np.ones(len(rows)), (rows, cols)), shape=(len(triangles),) * 2), directed=False)
    borders: dict[int, dict[int, int]] = defaultdict(dict)
    for (p, q), i in owner.items():
        if group[owner[q, p]] != group[i]:
            borders[int(group[i])][p] = q
    return [_face(corners, normals[(group == g) & (areas > 0)].mean(axis=0), border) for g, border in sorted(borders.items())]


def _coplanar(normals: NDArray, areas: NDArray, i: int, j: int) -> bool:
    """Slivers, whose normals mean nothing, join whatever is beside them."""
    sliver = min(areas[i], areas[j]) < 1e-12
    return bool(sliver or np.linalg.norm(normals[i] - normals[j]) < COPLANAR_RAD)


def _face(corners: NDArray, normal: NDArray, border: dict[int, int]) -> Face:
    """Loops chained from the directed sides of a border; the outer one is the one that runs counter-clockwise."""
    border = dict(border)
    loops = []
    while border:
        first, after = next(iter(border.items()))
        loop = [first]
        del border[first]
        while after != first:
            loop.append(after)
            if after not in border:
                raise BadInput("a face touches itself at a corner; move the corner so that each face has a simple outline.")
            after = border.pop(after)
        loops.append(tuple(loop))
    areas = [_area_vector(corners[list(loop)]) @ normal for loop in loops]
    outer = int(np.argmax(areas))
    return Face(loops[outer], tuple(loop for k, loop in enumerate(loops) if k != outer))


def _drop_straight_corners(corners: NDArray, faces: list[Face]) -> list[Face]:
    """Without corners that lie on a straight line in every loop that they belong to."""
    bent: set[int] = set()
    for face in faces:
        for loop in face.loops:
            for before, here, after in zip(loop[-1:] + loop[:-1], loop, loop[1:] + loop[:1], strict=True):
                u, v = corners[here] - corners[before], corners[after] - corners[here]
                if np.linalg.norm(np.cross(u, v)) > 1e-4 * np.linalg.norm(u) * np.linalg.norm(v):
                    bent.add(here)
    keep = [[tuple(c for c in loop if c in bent) for loop in face.loops] for face in faces]
    return [Face(loops[0], tuple(loops[1:])) for loops in keep]


def _compact(corners: NDArray, faces: list[Face]) -> Polyhedron:
    used = sorted({c for face in faces for loop in face.loops for c in loop})
    number = {old: new for new, old in enumerate(used)}
    renumbered = tuple(Face(*(_renumber(face, number))) for face in faces)
    return Polyhedron(corners[used], renumbered)


def _renumber(face: Face, number: dict[int, int]) -> tuple[tuple[int, ...], tuple[tuple[int, ...], ...]]:
    return tuple(number[c] for c in face.outer), tuple(tuple(number[c] for c in hole) for hole in face.holes)
