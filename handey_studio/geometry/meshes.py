"""Polyhedra from polygons over corners, as files and computations give them: welded, checked, coplanar neighbours made faces."""

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from handey_studio.base import BadInput
from handey_studio.geometry.caps import without_caps
from handey_studio.geometry.planar_faces import planar_faces, without_straight_corners
from handey_studio.geometry.polyhedron import Face, Polyhedron, area_vector
from handey_studio.geometry.soundness import crossings, unmatched_sides

WELD_M = 1e-6  # corners closer than this are one corner: far below any part's tolerance, above STL's float32 rounding
MAX_TRIANGLES = 5000  # more than this is a scan or a rounded shape, not a polyhedral part


def polyhedron_from_polygons(vertices: ArrayLike, polygons: list[list[int]]) -> Polyhedron:
    """A validated polyhedron from corners (n, 3) [m] and polygons (corner numbers, outward).

    Corners that coincide are welded, triangles without area taken out, coplanar neighbours merged into one face (so faces may get holes),
    and corners in the middle of a straight edge dropped. Raises BadInput with one sentence when the surface is not a closed solid.
    """
    corners = np.asarray(vertices, dtype=float).reshape(-1, 3)
    if not np.isfinite(corners).all():
        raise BadInput("a corner is not a finite number; every coordinate must be finite metres.")
    triangles = triangles_of(corners, polygons)
    if len(triangles) > MAX_TRIANGLES:
        raise BadInput(f"it has {len(triangles)} triangles, the limit for a polyhedral part is {MAX_TRIANGLES}; simplify the mesh.")
    corners, triangles = welded(corners, triangles)
    check_closed(triangles)
    triangles = without_caps(corners, triangles, WELD_M)
    if np.einsum("ij,ij->i", corners[triangles[:, 0]], np.cross(corners[triangles[:, 1]], corners[triangles[:, 2]])).sum() < 0:
        triangles = triangles[:, ::-1]
    _check_no_self_intersection(corners, triangles)
    faces = without_straight_corners(corners, planar_faces(corners, triangles))
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


def prism(outline: ArrayLike, height: float) -> Polyhedron:
    """An outline (n, 2) [m], counter-clockwise, extruded from z = 0 to `height` [m]."""
    outline = np.asarray(outline, dtype=float)
    n = len(outline)
    corners = np.concatenate([np.c_[outline, np.zeros(n)], np.c_[outline, np.full(n, height)]])
    sides = [[i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n)]
    return polyhedron_from_polygons(corners, [list(range(n))[::-1], list(range(n, 2 * n)), *sides])


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
    area = area_vector(points)
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


def standing_for(corners: NDArray, within: float = WELD_M) -> NDArray:
    """For each corner (n, 3) the number of the one that stands for all that are `within` [m] of it, or of one another."""
    pairs = KDTree(corners).query_pairs(within, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(corners),) * 2)
    count, group = connected_components(links, directed=False)
    first = np.full(count, len(corners))
    np.minimum.at(first, group, np.arange(len(corners)))
    return first[group]


def welded(corners: NDArray, triangles: NDArray) -> tuple[NDArray, NDArray]:
    """Coinciding corners made one, which stand in the order of their coordinates; triangles that lost a corner dropped."""
    stands = standing_for(corners)
    kept = np.unique(stands)
    kept = kept[np.lexsort(np.round(corners[kept] / WELD_M).T[::-1])]
    number = np.empty(len(corners), dtype=np.int64)
    number[kept] = np.arange(len(kept))
    triangles = number[stands[triangles]]
    distinct = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return corners[kept], triangles[distinct]


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


def _compact(corners: NDArray, faces: list[Face]) -> Polyhedron:
    used = sorted({c for face in faces for loop in face.loops for c in loop})
    number = {old: new for new, old in enumerate(used)}
    renumbered = tuple(Face(*(_renumber(face, number))) for face in faces)
    return Polyhedron(corners[used], renumbered)


def _renumber(face: Face, number: dict[int, int]) -> tuple[tuple[int, ...], tuple[tuple[int, ...], ...]]:
    return tuple(number[c] for c in face.outer), tuple(tuple(number[c] for c in hole) for hole in face.holes)
