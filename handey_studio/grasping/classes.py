"""Grasp classes (Handey 1987 §5.1, Figure 6): choices of object features that the two fingers may touch.

The paper names three pairs of features: two parallel faces, a face and a parallel edge, a face and a vertex. The finger opposite a face
lies with its pad's plane parallel to it, on the other face or touching the edge or the vertex, where the solid leans away from the pad.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from handey_studio.base import Entry, Ledger, Value, frozen_array
from handey_studio.world import Hand, Part

Kind = Literal["faces", "face and edge", "face and vertex"]

Pair = tuple[int, int, float, float, Callable[[NDArray], BaseGeometry]]
"""Face, the other feature's number, width [m], lean [rad] of the solid off the pad there, and the feature in a frame's x, y."""

OPEN_CLEARANCE_MIN_M = 0.002  # the open hand passes the part with at least this much on each side
OPEN_CLEARANCE_M = 0.006  # and with this much where it can


@dataclass(frozen=True)
class GraspOptions:
    """Angles in radians, lengths in metres.

    Features within `parallel` count as parallel: the fingers' pads comply with that much. The faces beside a grasped edge, and the edges
    beside a grasped vertex, lean at least `least_lean` off the pad. A finger covers at least `least_edge` of a grasped edge.
    """

    parallel: float = float(np.deg2rad(1.0))
    least_lean: float = float(np.deg2rad(5.0))
    least_edge: float = 0.006


@dataclass(frozen=True, eq=False)
class GraspClass(Value):
    """A face and what lies opposite it: a parallel face, edge or vertex.

    `features` are the number of the face and of the other face, edge (of `Polyhedron.edges`) or vertex. `T_part_plane` is the grasp plane's
    frame: x along the face's outward normal, which is the closing direction, origin midway between the features; y and z lie in the
    plane. `width` [m] between them. `surfaces` are both features in y, z [m]: a polygon; a polygon, a line or a point. A finger covers at
    least `least_length` [m] of an edge.
    """

    kind: Kind
    features: tuple[int, int]
    T_part_plane: NDArray
    width: float
    surfaces: tuple[BaseGeometry, BaseGeometry]
    least_length: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_part_plane", frozen_array(self.T_part_plane))

    @cached_property
    def contact(self) -> BaseGeometry:
        """Where the two features face each other, in y, z [m]: polygons of two faces, pieces of an edge, or a point."""
        return self.surfaces[0].intersection(self.surfaces[1])

    @property
    def faces(self) -> tuple[int, ...]:
        """The grasped faces, one or two."""
        return self.features if self.kind == "faces" else self.features[:1]

    @property
    def outline(self) -> NDArray:
        """Corners (k, 2) [m] of the largest piece of `contact`."""
        pieces = shapely.get_parts(self.contact)
        if not len(pieces):
            return np.empty((0, 2))
        return shapely.get_coordinates(max(pieces, key=lambda piece: (piece.area, piece.length)))

    @property
    def name(self) -> str:
        f, g = self.features
        other = {"faces": f"–{g}", "face and edge": f" and edge {g}", "face and vertex": f" and vertex {g}"}[self.kind]
        return f"face{'s' if self.kind == 'faces' else ''} {f}{other} ({1e3 * self.width:.0f} mm)"


def hand_in_plane(point: NDArray, angle: float, side: int) -> NDArray:
    """T_plane_hand (4, 4): fingertips at a point (y, z) of the grasp plane, fingers along `angle`; `side` ±1 swaps the fingers."""
    z = np.array([0.0, np.cos(angle), np.sin(angle)])
    x = np.array([float(side), 0.0, 0.0])
    T = np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2] = x, np.cross(z, x), z
    T[1:3, 3] = point
    return T


def contact_area(grasp_class: GraspClass, hand: Hand, point: NDArray, angle: float) -> float:
    """Area [m²] of contact when the fingertips are at a point (y, z) of the grasp plane: see `contact_areas`."""
    return float(contact_areas(grasp_class, hand, np.asarray(point)[None], np.array([angle]))[0])


def contact_areas(grasp_class: GraspClass, hand: Hand, points: NDArray, angles: NDArray) -> NDArray:
    """Areas (k,) [m²] of contact for fingertips at points (k, 2) of the grasp plane and hand angles (k,) [rad].

    Of two faces it is what both fingers cover where the faces face each other. Opposite an edge or a vertex it is what the finger on the
    face covers of it evenly around that (`evenly`), and 0 where the other finger covers too little of the edge, or misses the vertex.
    """
    pads = finger_pads(hand, points, angles)
    shared = np.asarray(shapely.intersection(pads, grasp_class.contact))
    if grasp_class.kind == "faces":
        return np.asarray(shapely.area(shared))
    touched = ~shapely.is_empty(shared) & (shapely.length(shared) >= grasp_class.least_length)
    areas = np.zeros(len(pads))
    areas[touched] = shapely.area(evenly(shapely.intersection(pads[touched], grasp_class.surfaces[0]), shared[touched]))
    return areas


def evenly(patches: NDArray, touched: NDArray) -> NDArray:
    """What patches (k,) of a face have on both sides alike of what is touched opposite them (k,): pressed there, they push back in line."""
    middles = np.repeat(shapely.get_coordinates(shapely.centroid(touched)), shapely.get_num_coordinates(patches), axis=0)
    return np.asarray(shapely.intersection(patches, shapely.transform(patches, lambda points: 2.0 * middles - points)))


def finger_pads(hand: Hand, points: NDArray, angles: NDArray) -> NDArray:
    """The fingers' outlines in the grasp plane, polygons (k,), for fingertips at points (k, 2) [m] and hand angles (k,) [rad]."""
    along = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1) * hand.finger_width / 2.0
    roots = points - hand.finger_length * along
    return np.asarray(shapely.polygons(np.stack([points - across, points + across, roots + across, roots - across], axis=1)))


@lru_cache(maxsize=32)
def grasp_classes(part: Part, hand: Hand, options: GraspOptions = GraspOptions()) -> tuple[tuple[GraspClass, ...], tuple[Entry, ...]]:
    """All pairs of features that the hand can take, faces first, and the ledger of those that it cannot.

    A face that lies flat against the pad has its edges and vertices on the pad as well; they are no classes of their own.
    """
    ledger, found = Ledger(), []
    kinds: dict[Kind, Callable[[Part, GraspOptions], list[Pair]]]
    kinds = {"faces": _face_pairs, "face and edge": _face_edges, "face and vertex": _face_vertices}
    for kind, pairs in kinds.items():
        for f, number, width, lean, surface in pairs(part, options):
            least = options.least_edge if kind == "face and edge" else 0.0
            T = _plane_frame(part, f, width)
            face = part.solid.face_polygon(f, _facing(T))
            candidate = GraspClass(kind, (f, number), T, width, (face, surface(_facing(T))), least)
            entry = ledger.add("grasp class", f"{kind} {f}–{number}")
            fault = _fault(candidate, lean, hand, options)
            if fault is None:
                found.append(candidate)
            else:
                reason, value, limit, unit = fault
                ledger.fall(entry, reason, value=value, limit=limit, unit=unit)
    return tuple(found), ledger.entries


def _fault(candidate: GraspClass, lean: float, hand: Hand, options: GraspOptions) -> tuple[str, float, float, str] | None:
    """Why a hand cannot take a class: words, the number, the limit and their unit."""
    width, most = candidate.width, hand.opening_max - 2 * OPEN_CLEARANCE_MIN_M
    if width <= 0:
        return "the faces look at each other across a gap, not through the part", width, 0.0, "m"
    if not hand.opening_min <= width <= most:
        return "the hand does not open that far", width, hand.opening_min if width < hand.opening_min else most, "m"
    if lean < options.least_lean:
        return "the part lies too flat against the pad beside it", lean, options.least_lean, "rad"
    if candidate.kind == "face and vertex" and candidate.contact.is_empty:
        return "the vertex lies beside the face", candidate.surfaces[0].distance(candidate.surfaces[1]), 0.0, "m"
    if candidate.kind == "face and edge" and candidate.contact.length < options.least_edge:
        return "too little of the edge lies opposite the face", candidate.contact.length, options.least_edge, "m"
    area = candidate.contact.area if candidate.kind == "faces" else candidate.surfaces[0].area
    if area < hand.min_contact_area:
        return "the faces overlap too little", area, hand.min_contact_area, "m²"
    return None


def _face_pairs(part: Part, options: GraspOptions) -> list[Pair]:
    solid = part.solid
    return [
        (f, g, float(solid.offsets[f] + solid.offsets[g]), np.pi / 2, lambda T, g=g: solid.face_polygon(g, T))
        for f, g in combinations(range(len(solid.faces)), 2)
        if solid.normals[f] @ solid.normals[g] <= -np.cos(options.parallel)
    ]


def _face_edges(part: Part, options: GraspOptions) -> list[Pair]:
    """Faces and the convex edges parallel to them that a pad opposite the face can touch without lying on a face."""
    solid, pairs = part.solid, []
    for f, normal in enumerate(solid.normals):
        for number, edge in enumerate(solid.edges):
            ends = solid.vertices[[edge.start, edge.end]]
            along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
            if edge.dihedral <= 0 or abs(along @ normal) > np.sin(options.parallel):
                continue
            beside = solid.normals[[edge.left, edge.right]]
            turns = np.cross(beside[0], -normal) @ along, np.cross(-normal, beside[1]) @ along
            lean = float(np.arccos(np.clip(-beside @ normal, -1.0, 1.0)).min())
            if min(turns) <= 0 or lean <= options.parallel:
                continue
            width = float(solid.offsets[f] - normal @ ends.mean(axis=0))
            pairs.append((f, number, width, lean, lambda T, ends=ends: shapely.LineString(_flat(ends, T))))
    return pairs


def _face_vertices(part: Part, options: GraspOptions) -> list[Pair]:
    """Faces and the convex corners that a pad opposite the face can touch without touching an edge."""
    solid, pairs = part.solid, []
    for number, corner in enumerate(solid.vertices):
        edges = [edge for edge in solid.edges if number in (edge.start, edge.end)]
        if not edges or min(edge.dihedral for edge in edges) <= 0:
            continue
        away = solid.vertices[[edge.end if edge.start == number else edge.start for edge in edges]] - corner
        away = away / np.linalg.norm(away, axis=1, keepdims=True)
        for f, normal in enumerate(solid.normals):
            lean = float(np.arcsin(np.clip(away @ normal, -1.0, 1.0)).min())
            if lean <= options.parallel:
                continue
            width = float(solid.offsets[f] - normal @ corner)
            pairs.append((f, number, width, lean, lambda T, corner=corner: shapely.Point(_flat(corner[None], T)[0])))
    return pairs


def _plane_frame(part: Part, f: int, width: float) -> NDArray:
    """T_part_plane: x along the outward normal of face f, y along the face's first side."""
    face = part.solid.face_frame(f)
    T = np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2] = face[:3, 2], face[:3, 0], face[:3, 1]
    T[:3, 3] = face[:3, 3] - width / 2.0 * face[:3, 2]
    return T


def _facing(T_part_plane: NDArray) -> NDArray:
    """The same frame with y, z of the plane as its x, y: what polygons are measured in."""
    return T_part_plane[:, [1, 2, 0, 3]]


def _flat(points: NDArray, T: NDArray) -> NDArray:
    """Points (n, 3) in the x, y (n, 2) of a frame."""
    return (points - T[:3, 3]) @ T[:3, :2]
