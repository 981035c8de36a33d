"""Grasp classes and approach groups (Handey 1987 §5.1, Figure 6).

A grasp class is a choice of object surfaces: here two parallel faces. Within a class the approach directions fall into groups
by the edge of the grasp face that is crossed first.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.base import Entry, Ledger, Value, frozen_array
from handey_studio.world import Hand, Part

PARALLEL_RAD = np.deg2rad(1.0)  # faces within this angle count as parallel: the fingers' pads comply with that much
EDGE_SHARES = (0.5, 0.25, 0.75)  # where along the first edge the finger may enter
DEEPER_M = 0.008  # a second try enters this much deeper than the least penetration
SPARE_AREA = 1.25  # the least penetration covers the least contact area this many times over


@dataclass(frozen=True, eq=False)
class GraspClass(Value):
    """Two parallel faces that the fingers may touch.

    `T_part_plane` is the grasp plane's frame: x along the closing direction, origin midway between the faces; y and z lie in
    the plane. `contact` is where the two faces face each other, a polygon in y, z [m]. `width` [m] between the faces.
    """

    faces: tuple[int, int]
    T_part_plane: NDArray
    width: float
    contact: shapely.Geometry

    @property
    def outline(self) -> NDArray:
        """Corners (k, 2) [m] of the largest piece of `contact`."""
        polygons = [piece for piece in shapely.get_parts(self.contact) if isinstance(piece, shapely.Polygon)]
        return shapely.get_coordinates(max(polygons, key=lambda polygon: polygon.area).exterior) if polygons else np.empty((0, 2))

    @property
    def name(self) -> str:
        return f"faces {self.faces[0]}–{self.faces[1]} ({1e3 * self.width:.0f} mm)"


@dataclass(frozen=True, eq=False)
class GraspGroup(Value):
    """The approach directions that cross the same edge of the grasp face first.

    `edge` (2, 2) [m] its ends in the plane's y, z; `point` (2,) [m] where the fingertips' centre goes; `angle` [rad] of the
    approach across the edge at right angles, in the plane, from y towards z. `share` and `depth` [m] say where along the edge and
    how far beyond it the point lies.
    """

    grasp_class: GraspClass
    edge_number: int
    edge: NDArray
    point: NDArray
    angle: float
    share: float
    depth: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "edge", frozen_array(self.edge))
        object.__setattr__(self, "point", frozen_array(self.point))

    @property
    def name(self) -> str:
        where = {0.5: "centre", 0.25: "first quarter", 0.75: "last quarter"}[self.share]
        return f"{self.grasp_class.name}, edge {self.edge_number}, {where}, {1e3 * self.depth:.0f} mm deep"


def hand_in_plane(point: NDArray, angle: float, side: int) -> NDArray:
    """T_plane_hand (4, 4): fingertips at a point (y, z) of the grasp plane, fingers along `angle`; `side` ±1 swaps the fingers."""
    z = np.array([0.0, np.cos(angle), np.sin(angle)])
    x = np.array([float(side), 0.0, 0.0])
    T = np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2] = x, np.cross(z, x), z
    T[1:3, 3] = point
    return T


def contact_area(grasp_class: GraspClass, hand: Hand, point: NDArray, angle: float) -> float:
    """Area [m²] of each finger's contact with its face when the fingertips are at a point (y, z) of the grasp plane."""
    return float(_finger_pad(hand, point, angle).intersection(grasp_class.contact).area)


def _finger_pad(hand: Hand, point: NDArray, angle: float) -> shapely.Polygon:
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]]) * hand.finger_width / 2.0
    root = point - hand.finger_length * along
    return shapely.Polygon([point - across, point + across, root + across, root - across])


@lru_cache(maxsize=32)
def grasp_classes(part: Part, hand: Hand) -> tuple[tuple[GraspClass, ...], tuple[Entry, ...]]:
    """All pairs of parallel faces that the hand can take, and the ledger of those that it cannot."""
    ledger = Ledger()
    solid, classes = part.solid, []
    for f, g in combinations(range(len(solid.faces)), 2):
        if solid.normals[f] @ solid.normals[g] > -np.cos(PARALLEL_RAD):
            continue
        width = float(solid.offsets[f] + solid.offsets[g])
        entry = ledger.add("grasp class", f"faces {f}–{g}")
        if width <= 0:
            ledger.fall(entry, "the faces look at each other across a gap, not through the part", value=width, limit=0.0, unit="m")
            continue
        if not hand.opening_min <= width <= hand.opening_max - 2 * OPEN_CLEARANCE_MIN_M:
            limit = hand.opening_min if width < hand.opening_min else hand.opening_max - 2 * OPEN_CLEARANCE_MIN_M
            ledger.fall(entry, "the hand does not open that far", value=width, limit=limit, unit="m")
            continue
        T = _plane_frame(part, f, width)
        contact = part.solid.face_polygon(f, _facing(T)).intersection(part.solid.face_polygon(g, _facing(T)))
        if contact.area < hand.min_contact_area:
            ledger.fall(entry, "the faces overlap too little", value=contact.area, limit=hand.min_contact_area, unit="m²")
            continue
        classes.append(GraspClass((f, g), frozen_array(T), width, contact))
    return tuple(classes), ledger.entries


OPEN_CLEARANCE_MIN_M = 0.002  # the open hand passes the part with at least this much on each side
OPEN_CLEARANCE_M = 0.006  # and with this much where it can


def opening_around(hand: Hand, width: float) -> float:
    """How far [m] the hand opens to go around a part of that width."""
    return min(width + 2 * OPEN_CLEARANCE_M, hand.opening_max)


@lru_cache(maxsize=32)
def grasp_groups(part: Part, hand: Hand) -> tuple[tuple[GraspGroup, ...], tuple[Entry, ...]]:
    """The approach groups of every class, and the ledger of classes and edges that give none. Depends on no scene."""
    classes, entries = grasp_classes(part, hand)
    ledger = Ledger()
    ledger.adopt(entries)
    groups: list[GraspGroup] = []
    for grasp_class in classes:
        polygons = [p for p in shapely.get_parts(grasp_class.contact) if p.geom_type == "Polygon"]
        edges = [edge for polygon in polygons for edge in _outline_edges(polygon)]
        for number, edge in enumerate(edges):
            found = _groups_of_edge(grasp_class, hand, number, edge)
            if not found:
                option = f"{grasp_class.name}, edge {number}"
                ledger.add("approach group", option, "the fingers find too little contact behind this edge",
                           limit=hand.min_contact_area, unit="m²")  # fmt: skip
            groups += found
    return tuple(groups), ledger.entries


def _groups_of_edge(grasp_class: GraspClass, hand: Hand, number: int, edge: NDArray) -> list[GraspGroup]:
    along = edge[1] - edge[0]
    length = float(np.linalg.norm(along))
    inward = np.array([-along[1], along[0]]) / length
    angle = float(np.arctan2(inward[1], inward[0]))
    groups = []
    for share in EDGE_SHARES if length > 1.5 * hand.finger_width else EDGE_SHARES[:1]:
        entry_point = edge[0] + share * along
        least = _least_depth(grasp_class, hand, entry_point, inward, angle)
        if least is None:
            continue
        for depth in (least, least + DEEPER_M):
            point = entry_point + depth * inward
            groups.append(GraspGroup(grasp_class, number, edge, point, angle, share, depth))
    return groups


def _least_depth(grasp_class: GraspClass, hand: Hand, entry: NDArray, inward: NDArray, angle: float) -> float | None:
    """The least penetration [m], in whole millimetres, that covers the least contact area with some to spare."""
    for depth in np.arange(1, round(1e3 * hand.finger_length)) * 1e-3:
        if contact_area(grasp_class, hand, entry + depth * inward, angle) >= SPARE_AREA * hand.min_contact_area:
            return float(depth)
    return None


def _outline_edges(polygon: shapely.Polygon) -> list[NDArray]:
    """The outer edges (2, 2) of a polygon, the inside on their left."""
    ring = shapely.get_coordinates(shapely.orient_polygons(polygon).exterior)
    return [ring[k : k + 2].copy() for k in range(len(ring) - 1) if np.linalg.norm(ring[k + 1] - ring[k]) > 1e-3]


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
