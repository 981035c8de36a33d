"""References looked up in a solid: the face, edge or corner that a person meant, also after earlier steps were edited."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.base import BadInput, measured
from handey_studio.geometry import Edge, Polyhedron
from handey_studio.modeling.planes import told_point
from handey_studio.modeling.references import CornerAt, EdgeAt, FaceAt


@dataclass(frozen=True)
class LookUpOptions:
    """How far from a reference a thing may be and still be meant.

    It may have turned by `most_turn` [rad], and a turn of one radian counts as `turn_m` [m] of distance: two faces that meet at an edge
    are told apart by their normals even where the reference lies on the edge. Nothing farther than `reach` [m] is meant.
    """

    most_turn: float = float(np.deg2rad(40.0))
    turn_m: float = 0.05
    reach: float = 0.25


def face_at(solid: Polyhedron, at: FaceAt, options: LookUpOptions = LookUpOptions()) -> int:
    """The number of the face that is meant. Raises BadInput when none is near with about that normal."""
    turns = _angles(np.clip(solid.normals @ at.normal, -1.0, 1.0))
    costs = np.full(len(solid.faces), np.inf)
    for f in np.flatnonzero(turns <= options.most_turn):
        costs[f] = _distance_to_face(solid, int(f), at.point) + options.turn_m * turns[f]
    return _best(costs, options, "face", at.point)


def edge_at(solid: Polyhedron, at: EdgeAt, options: LookUpOptions = LookUpOptions()) -> tuple[Edge, int]:
    """The edge that is meant, and the corner at the end that the reference's direction leads to. Raises BadInput."""
    edges = solid.edges
    starts, ends = solid.vertices[[e.start for e in edges]], solid.vertices[[e.end for e in edges]]
    lengths = np.linalg.norm(ends - starts, axis=1)
    directions = (ends - starts) / lengths[:, None]
    turns = _angles(np.abs(directions @ at.direction))
    along = np.clip(np.einsum("ij,ij->i", at.point - starts, directions), 0.0, lengths)
    distances = np.linalg.norm(starts + along[:, None] * directions - at.point, axis=1)
    costs = np.where(turns <= options.most_turn, distances + options.turn_m * turns, np.inf)
    e = _best(costs, options, "edge", at.point)
    return edges[e], edges[e].end if directions[e] @ at.direction > 0 else edges[e].start


def corner_at(solid: Polyhedron, at: CornerAt, options: LookUpOptions = LookUpOptions()) -> int:
    """The number of the corner that is meant. Raises BadInput."""
    return _best(np.linalg.norm(solid.vertices - at.point, axis=1), options, "corner", at.point)


def reference_to_face(solid: Polyhedron, f: int) -> FaceAt:
    """A reference to a face: a point well inside it and its normal."""
    T = solid.face_frame(f)
    inside = shapely.get_coordinates(solid.face_polygon(f, T).representative_point())[0]
    return FaceAt(T[:3, 3] + T[:3, :2] @ inside, solid.normals[f])


def _distance_to_face(solid: Polyhedron, f: int, point: NDArray) -> float:
    T = solid.face_frame(f)
    x, y, z = T[:3, :3].T @ (point - T[:3, 3])
    return float(np.hypot(z, solid.face_polygon(f, T).distance(shapely.Point(x, y))))


def _angles(cosines: NDArray) -> NDArray:
    return np.arccos(np.clip(cosines, -1.0, 1.0))


def _best(costs: NDArray, options: LookUpOptions, what: str, point: NDArray) -> int:
    best = int(np.argmin(costs))
    if costs[best] > options.reach:
        near = f"; the nearest is {measured(float(costs[best]), 'm')} off" if np.isfinite(costs[best]) else ""
        raise BadInput(f"the {what} that is meant at {told_point(point)} is not there{near}; pick it again.")
    return best
