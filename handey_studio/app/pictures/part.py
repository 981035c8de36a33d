"""A part as a small picture: its outline in a grasp plane, and an icon of how it stands."""

from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.pictures.svg import PlaneView, polygon, polyline
from handey_studio.geometry.transforms import inverse
from handey_studio.world import Part

SIGHT = np.array([0.55, -0.72, 0.42])  # towards the eye
LIGHT = np.array([0.25, -0.45, 0.86])


def part_in_plane(part: Part, T_part_plane: NDArray, view: PlaneView, opacity: float = 0.30) -> str:
    """The part's silhouette in a grasp plane, with the edges of the faces that look towards the eye."""
    outline, edges = _flat(part, np.asarray(T_part_plane).tobytes())
    shapes = "".join(polygon(view.pixels(ring), palette.ORANGE, opacity) for ring in outline)
    return shapes + "".join(polyline(view.pixels(edge), palette.EDGE, 1.0, opacity=0.75) for edge in edges)


@lru_cache(maxsize=256)
def _flat(part: Part, T_part_plane: bytes) -> tuple[tuple[NDArray, ...], NDArray]:
    """Rings (k, 2) [m] of the silhouette and edges (n, 2, 2) [m] in y, z of the plane."""
    T = inverse(np.frombuffer(T_part_plane).reshape(4, 4))
    corners, solid = part.solid.vertices @ T[:3, :3].T + T[:3, 3], part.solid
    seen = solid.normals @ T[0, :3] > 1e-6
    outline = shapely.union_all(shapely.polygons(corners[solid.triangles][..., 1:]))
    rings = tuple(shapely.get_coordinates(piece.exterior) for piece in shapely.get_parts(outline) if isinstance(piece, shapely.Polygon))
    edges = np.array([[edge.start, edge.end] for edge in solid.edges if seen[edge.left] or seen[edge.right]], dtype=int).reshape(-1, 2)
    return rings, corners[edges][..., 1:]


def part_icon(part: Part, T: NDArray, middle: NDArray, size: float) -> str:
    """The part turned by T (4, 4), seen from above and the front, around a pixel (2,), at most `size` pixels large."""
    eye = SIGHT / np.linalg.norm(SIGHT)
    right = np.array([-eye[1], eye[0], 0.0]) / np.hypot(eye[0], eye[1])
    solid = part.solid
    corners, normals = solid.vertices @ T[:3, :3].T, solid.normals @ T[:3, :3].T
    flat = np.stack([corners @ right, -(corners @ np.cross(eye, right))], axis=1)
    flat = middle + (flat - (flat.min(axis=0) + flat.max(axis=0)) / 2.0) * (size / solid.diameter)
    faces = [f for f in range(len(solid.faces)) if normals[f] @ eye > 1e-6]
    faces.sort(key=lambda f: float((corners[list(solid.faces[f].outer)] @ eye).mean()))
    return "".join(polygon(flat[list(solid.faces[f].outer)], _shade(normals[f]), 1.0, palette.EDGE, 0.6) for f in faces)


def _shade(normal: NDArray) -> palette.RGB:
    """Lighter where a face looks towards the light."""
    share = 0.60 + 0.40 * max(0.0, float(normal @ LIGHT))
    r, g, b = (int(min(255.0, share * c + 18.0)) for c in palette.ORANGE)
    return r, g, b
