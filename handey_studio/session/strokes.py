"""What clicks on the screen mean as steps of a model: snaps become references, planes and outlines. Values in the model's frame [m]."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.modeling.lookup import face_at
from handey_studio.modeling.operations import Box, Combine
from handey_studio.modeling.picking.snap import MODEL, Snap
from handey_studio.modeling.picking.snapping import Pickable
from handey_studio.modeling.references import CornerAt, EdgeAt, FaceAt
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.sketch_plane import guides_in_plane, sketch_plane
from handey_studio.modeling.sketching import Guides
from handey_studio.modeling.taking import reference_of

IN_PLANE_M = 0.003  # an edge this near to a sketch's plane is in it
PARALLEL = float(np.cos(np.deg2rad(0.5)))


def on_model(snap: Snap) -> FaceAt | EdgeAt | CornerAt | None:
    """The face, edge or corner of the model that was clicked; None for anything else."""
    return reference_of(snap) if snap.owner == MODEL else None


def box_of(clicks: Sequence[Snap], eye: NDArray, depth: float | None, combine: Combine) -> Box:
    """A box from three clicks on a face that looks towards the eye. Raises BadInput when they lie on a line."""
    points = np.array([snap.point for snap in clicks])
    normal = plane_normal(points, eye)
    seen = [snap.normal for snap in clicks if snap.normal.any()]
    if seen:
        normal = seen[0]
    return Box(points, normal, depth, combine)


def plane_normal(points: NDArray, eye: NDArray) -> NDArray:
    """Unit normal (3,) towards the eye of the plane through three points (3, 3) [m]. Raises BadInput when they lie on a line."""
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    length = float(np.linalg.norm(normal))
    sides = np.linalg.norm(points[1:] - points[0], axis=1)
    if length < 1e-3 * max(sides.max(), 1e-9) ** 2:
        raise BadInput("the three clicks lie on a line or on one another; they must span a plane.")
    normal = normal / length
    return normal if normal @ (eye - points[0]) > 0 else -normal


def plane_of(snap: Snap) -> tuple[NDArray, NDArray]:
    """Point and unit normal of the plane that was clicked. Raises BadInput when the click met no plane."""
    if not snap.normal.any():
        raise BadInput(f"{snap.of} has no plane; click inside a face or a patch.")
    return snap.point, snap.normal


def sketch_frame(snap: Snap, scene: Pickable) -> NDArray:
    """T_model_plane (4, 4) of a sketch on the plane that was clicked, x along its longest edge."""
    point, normal = plane_of(snap)
    starts, ends = scene.edges.starts, scene.edges.ends
    off = np.maximum(np.abs((starts - point) @ normal), np.abs((ends - point) @ normal))
    lengths = np.where(off < IN_PLANE_M, np.linalg.norm(ends - starts, axis=1), 0.0)
    longest = int(np.argmax(lengths)) if len(lengths) and lengths.max() > 0.0 else -1
    return sketch_plane(point, normal, None if longest < 0 else ends[longest] - starts[longest])


def guides_of(scene: Pickable, T_model_plane: NDArray) -> Guides:
    """Corners and edges that lie in a sketch's plane."""
    segments = np.stack([scene.edges.starts, scene.edges.ends], axis=1)
    return guides_in_plane(T_model_plane, scene.corners.starts, segments)


def pixel_of(scan: Scan, T_model_scan: NDArray, point: NDArray) -> tuple[float, float]:
    """(u, v) [px] of a point (3,) [m] of the model's frame in a scan's image."""
    view = scan.view
    u, v = view.projection.project(apply(inverse(T_model_scan @ view.T_world_sensor), point))
    return float(u), float(v)


def on_plane(origin: NDArray, direction: NDArray, T_model_plane: NDArray) -> NDArray:
    """Where a line of sight meets a plane, in its x and y (2,) [m]. Raises BadInput when it does not."""
    start, way = apply(inverse(T_model_plane), origin), T_model_plane[:3, :3].T @ direction
    if abs(way[2]) < 1e-3 or -start[2] / way[2] <= 0.0:
        raise BadInput("the click does not meet the plane of the sketch; look at it from its front.")
    return (start - start[2] / way[2] * way)[:2]


def opposite_face(solid: Polyhedron, face: FaceAt) -> FaceAt | None:
    """The face parallel to a face that looks the other way and is nearest behind it; None where there is none."""
    number = face_at(solid, face)
    normal, offset = solid.normals[number], solid.offsets[number]
    behind = [f for f in range(len(solid.faces)) if solid.normals[f] @ normal < -PARALLEL and -solid.offsets[f] < offset]
    if not behind:
        return None
    nearest = max(behind, key=lambda f: -solid.offsets[f])
    return FaceAt(solid.vertices[list(solid.faces[nearest].outer)].mean(axis=0), solid.normals[nearest])
