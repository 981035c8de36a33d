"""A solid changed by hand: faces, edges and corners moved, dimensions typed. Faces stay planar, and keep their neighbours.

A face moves along its normal and its neighbours are lengthened or trimmed; an edge or a corner moves with the planes of the faces that
meet there, so that right angles stay right. What would break the solid is refused with how far it could have gone.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handey_studio.base import BadInput, measured
from handey_studio.geometry import Edge, Polyhedron
from handey_studio.geometry.transforms import rotation_about
from handey_studio.modeling.planes import Change, corners_on_planes, faces_at_corners, inherited, told_point
from handey_studio.modeling.soundness import shrunk, sound, with_same_faces, without_slivers
from handey_studio.modeling.sweeping import swept_face

PARALLEL_RAD = float(np.deg2rad(0.2))  # what the polyhedron itself takes for one plane
LEAST_WAY_M = 1e-6
CLEAR = 0.996  # a share of the way to where an edge ends that leaves no sliver
HALVINGS = 24  # finds how far a move can go, as a share of what was asked
SOUND_HALVINGS = 9  # the same where each try takes ten times as long


def moved_face(solid: Polyhedron, f: int, distance: float) -> Change:
    """The solid with face f moved along its normal by `distance` [m], outward when positive. Raises BadInput with the limit."""
    try:
        return _moved(solid, np.where(np.arange(len(solid.faces)) == f, distance, 0.0), "the face", abs(distance))
    except BadInput as refused:
        try:
            return swept_face(solid, f, distance)
        except BadInput:
            raise refused from None


def moved_edge(solid: Polyhedron, edge: Edge, way: ArrayLike) -> Change:
    """The solid with an edge moved by `way` (3,) [m], of which only what is across the edge counts. Raises BadInput with the limit."""
    along = solid.vertices[edge.end] - solid.vertices[edge.start]
    along = along / np.linalg.norm(along)
    across = np.asarray(way, dtype=float) - along * (along @ way)
    return _with_way(solid, [edge.left, edge.right], across, "the edge")


def moved_corner(solid: Polyhedron, corner: int, way: ArrayLike) -> Change:
    """The solid with a corner moved by `way` (3,) [m]: all faces that meet there move along their normals. Raises BadInput."""
    return _with_way(solid, faces_at_corners(solid)[corner], np.asarray(way, dtype=float), "the corner")


def with_distance(solid: Polyhedron, f: int, other: int, distance: float) -> Change:
    """The solid with face f moved until it is `distance` [m] from the parallel face `other`. Raises BadInput."""
    turn = float(np.arccos(np.clip(abs(solid.normals[f] @ solid.normals[other]), 0.0, 1.0)))
    if f == other or turn > PARALLEL_RAD:
        told = "one and the same" if f == other else f"{measured(turn, 'rad')} from parallel"
        raise BadInput(f"the two faces are {told}; a distance can be set between parallel faces only.")
    middle = solid.vertices[list(solid.faces[f].outer)].mean(axis=0)
    now = float(solid.normals[other] @ middle - solid.offsets[other])
    sense = float(np.sign(solid.normals[f] @ solid.normals[other]))
    return moved_face(solid, f, sense * (np.copysign(distance, now) - now))


def with_length(solid: Polyhedron, edge: Edge, end: int, length: float) -> Change:
    """The solid with an edge made `length` [m] long: the faces across its corner `end` move. Raises BadInput."""
    start = edge.start if end == edge.end else edge.end
    along = solid.vertices[end] - solid.vertices[start]
    now = float(np.linalg.norm(along))
    across = [f for f in faces_at_corners(solid)[end] if f not in (edge.left, edge.right)]
    return _with_way(solid, across, along / now * (length - now), "the end of the edge")


def with_angle(solid: Polyhedron, f: int, other: int, angle: float) -> Change:
    """The solid with face f turned about its edge with `other` until they meet at `angle` [rad], measured as `SetAngle` says. Raises
    BadInput."""
    edge = next((e for e in solid.edges if {e.left, e.right} == {f, other}), None)
    if edge is None:
        raise BadInput("the two faces do not meet at an edge; an angle can be set between neighbours only.")
    now = np.pi - abs(edge.dihedral)
    if abs(angle - now) < 1e-9:
        raise BadInput(f"the angle already is {measured(angle, 'rad')}; nothing would change.")
    along = solid.vertices[edge.end] - solid.vertices[edge.start]
    sense = np.sign(edge.dihedral) * (-1.0 if f == edge.right else 1.0)

    def turned(share: float) -> tuple[NDArray, NDArray]:
        normals, offsets = np.array(solid.normals), np.array(solid.offsets)
        normals[f] = rotation_about(along, sense * share * (angle - now)) @ normals[f]
        offsets[f] = normals[f] @ solid.vertices[edge.start]
        return normals, offsets

    return _changed(solid, turned, "the face", "turn", abs(angle - now), "rad")


def _with_way(solid: Polyhedron, faces: list[int], way: NDArray, what: str) -> Change:
    """The solid with the planes of some faces moved so that what they share moves by `way` (3,) [m]."""
    moves = np.zeros(len(solid.faces))
    moves[faces] = solid.normals[faces] @ way
    return _moved(solid, moves, what, float(np.linalg.norm(way)))


def _moved(solid: Polyhedron, moves: NDArray, what: str, distance: float) -> Change:
    """The solid with each face moved along its normal by `moves` (m,) [m]."""
    if np.abs(moves).max() < LEAST_WAY_M:
        raise BadInput(f"{what} would not move; nothing would change.")
    return _changed(solid, lambda share: (solid.normals, solid.offsets + share * moves), what, "move", distance, "m")


def _changed(
    solid: Polyhedron, planes: Callable[[float], tuple[NDArray, NDArray]], what: str, verb: str, asked: float, unit: str
) -> Change:
    """The solid with its faces in the planes that belong to share 1 of a change. Raises BadInput with the share that would be possible."""
    try:
        return _rebuilt(solid, *planes(1.0))
    except BadInput as error:
        reason = str(error)
    limit = measured(_limit(solid, planes) * asked, unit)
    raise BadInput(f"{what} cannot {verb} by {measured(asked, unit)} that way, the limit is {limit}: {reason}")


def _limit(solid: Polyhedron, planes: Callable[[float], tuple[NDArray, NDArray]]) -> float:
    """The share of a change that is possible, to half a percent: as far as no edge turns round, which is soon checked, else what stays
    sound."""
    share = _last_that(lambda share: _still(_corners, solid, *planes(share)), 1.0, HALVINGS)
    for near in (share, CLEAR * share):
        if _still(_rebuilt, solid, *planes(near)):
            return near
    return _last_that(lambda share: _still(_rebuilt, solid, *planes(share)), share, SOUND_HALVINGS)


def _last_that(holds: Callable[[float], bool], high: float, halvings: int) -> float:
    """The greatest share up to `high`, by halving, up to which a condition that holds at 0 still does."""
    if holds(high):
        return high
    low = 0.0
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _still(change: Callable[..., object], *given: object) -> bool:
    """Whether a change is not refused."""
    try:
        change(*given)
    except BadInput:
        return False
    return True


def _rebuilt(solid: Polyhedron, normals: NDArray, offsets: NDArray) -> Change:
    """The solid in other planes with the same neighbours. Raises BadInput."""
    corners = _corners(solid, normals, offsets)
    kept = with_same_faces(solid, corners)
    if kept is not None:
        return Change(without_slivers(kept, "it", solid), tuple(range(len(kept.faces))))
    changed = without_slivers(sound(corners, solid.faces), "it", solid)
    left = [f for f, face in enumerate(solid.faces) if not shrunk(corners[list(face.outer)])]
    drawn = Polyhedron(corners, tuple(solid.faces[f] for f in left))
    return Change(changed, inherited(changed, [(drawn, left)], left[0]))


def _corners(solid: Polyhedron, normals: NDArray, offsets: NDArray) -> NDArray:
    """The corners (n, 3) [m] in other planes: edges may shrink to nothing, but not turn round. Raises BadInput."""
    corners = corners_on_planes(solid, normals, offsets)
    starts, ends = [e.start for e in solid.edges], [e.end for e in solid.edges]
    before, after = solid.vertices[ends] - solid.vertices[starts], corners[ends] - corners[starts]
    lengths = np.linalg.norm(before, axis=1)
    left = np.einsum("ij,ij->i", after, before) / lengths
    if left.min() < -LEAST_WAY_M:
        e = int(np.argmin(left / lengths))
        middle = 0.5 * (solid.vertices[ends[e]] + solid.vertices[starts[e]])
        raise BadInput(f"the edge at {told_point(middle)} would shrink to nothing and turn round.")
    return corners
