"""Approach groups (Handey 1987 §5.1, Figure 6): within a grasp class, the approaches that cross the same edge of the grasp face first."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.base import Entry, Ledger, Value, frozen_array
from handey_studio.grasping.classes import OPEN_CLEARANCE_M, OPEN_CLEARANCE_MIN_M, GraspClass, contact_areas, grasp_classes
from handey_studio.world import Hand, Part

SHARES = (0.5, 0.25, 0.75)  # where along the first edge, or along a grasped edge, the finger may enter
DEEPER_M = 0.008  # a second try enters this much deeper than the least penetration
SPARE_AREA = 1.25  # the least penetration covers the least contact area this many times over
SPARE_DEPTH_M = 0.003  # and reaches this far beyond where it first covers enough of an edge, or a vertex
BELOW_M = 0.002  # what fingertips keep above what the part lies on
LEAST_EDGE_M = 0.001  # shorter pieces of an outline are no edges to cross
DEPTH_STEP_M = 0.001


@dataclass(frozen=True, eq=False)
class GraspGroup(Value):
    """The approach directions that cross the same edge of the grasp face first.

    `edge` (2, 2) [m] its ends in the plane's y, z; `point` (2,) [m] where the fingertips' centre goes; `angle` [rad] of the
    approach across the edge at right angles, in the plane, from y towards z. `share` and `depth` [m] say where along the edge and
    how far beyond it the point lies. The open hand passes the part at `clearance` [m] on each side.
    """

    grasp_class: GraspClass
    edge_number: int
    edge: NDArray
    point: NDArray
    angle: float
    share: float
    depth: float
    clearance: float = OPEN_CLEARANCE_M

    def __post_init__(self) -> None:
        object.__setattr__(self, "edge", frozen_array(self.edge))
        object.__setattr__(self, "point", frozen_array(self.point))

    @property
    def name(self) -> str:
        where = {0.5: "centre", 0.25: "first quarter", 0.75: "last quarter"}.get(round(self.share, 3), f"{self.share:.0%} along")
        return f"{self.grasp_class.name}, edge {self.edge_number}, {where}, {1e3 * self.depth:.0f} mm deep"

    @property
    def opened_less(self) -> "GraspGroup | None":
        """The same for the hand opened as little as goes around the part, where things stand close beside it; None if it is."""
        return replace(self, clearance=OPEN_CLEARANCE_MIN_M) if self.clearance > OPEN_CLEARANCE_MIN_M else None

    def opening(self, hand: Hand) -> float:
        """How far [m] the hand opens to go around the part."""
        return min(self.grasp_class.width + 2 * self.clearance, hand.opening_max)


@lru_cache(maxsize=32)
def grasp_groups(part: Part, hand: Hand) -> tuple[tuple[GraspGroup, ...], tuple[Entry, ...]]:
    """The approach groups of every class, and the ledger of classes and edges that give none. Depends on no scene."""
    classes, entries = grasp_classes(part, hand)
    ledger = Ledger()
    ledger.adopt(entries)
    groups: list[GraspGroup] = []
    for grasp_class in classes:
        for number, edge in enumerate(first_edges(grasp_class)):
            found = _groups_of_edge(grasp_class, hand, number, edge)
            if not found:
                ledger.add("approach group", f"{grasp_class.name}, edge {number}", "the fingers find too little contact behind this edge",
                           limit=hand.min_contact_area, unit="m²")  # fmt: skip
            groups += found
    return tuple(groups), ledger.entries


def first_edges(grasp_class: GraspClass) -> list[NDArray]:
    """The edges (2, 2) [m], in the plane's y, z, that an approach can cross first: of where two faces face each other, else of the face."""
    crossed = grasp_class.contact if grasp_class.kind == "faces" else grasp_class.surfaces[0]
    return [edge for piece in shapely.get_parts(crossed) if isinstance(piece, shapely.Polygon) for edge in _outline_edges(piece)]


def _groups_of_edge(grasp_class: GraspClass, hand: Hand, number: int, edge: NDArray) -> list[GraspGroup]:
    along = edge[1] - edge[0]
    length = float(np.linalg.norm(along))
    inward = np.array([-along[1], along[0]]) / length
    angle = float(np.arctan2(inward[1], inward[0]))
    groups = []
    for share in _shares(grasp_class, hand, edge, length):
        entry_point = edge[0] + share * along
        depths = _depths(grasp_class, hand, entry_point, inward, angle)
        groups += [GraspGroup(grasp_class, number, edge, entry_point + d * inward, angle, share, d) for d in depths]
    return groups


def _shares(grasp_class: GraspClass, hand: Hand, edge: NDArray, length: float) -> tuple[float, ...]:
    """Where along an edge (2, 2) the finger enters: opposite an edge or a vertex, straight towards that."""
    if grasp_class.kind == "faces":
        return SHARES if length > 1.5 * hand.finger_width else SHARES[:1]
    aims = []
    for piece in shapely.get_parts(grasp_class.contact):
        ends = shapely.get_coordinates(piece)
        aims += [ends[0] + s * (ends[-1] - ends[0]) for s in (SHARES if piece.length > hand.finger_width else SHARES[:1])]
    along = (np.array(aims) - edge[0]) @ (edge[1] - edge[0]) / length**2
    return tuple(dict.fromkeys(float(s) for s in np.round(along, 6) if 0.0 < s < 1.0))


def _depths(grasp_class: GraspClass, hand: Hand, entry: NDArray, inward: NDArray, angle: float) -> list[float]:
    """How far [m] beyond an edge the fingertips go, in whole millimetres; nothing if they find too little contact there.

    The least penetration that covers the least contact area with some to spare, and one that is deeper. Two faces that end about there may
    lie on something, so of these also the least that covers it at all.
    """
    depths = np.arange(1, round(hand.finger_length / DEPTH_STEP_M)) * DEPTH_STEP_M
    areas = contact_areas(grasp_class, hand, entry + depths[:, None] * inward, np.full(len(depths), angle))
    barely, enough = depths[areas >= hand.min_contact_area], depths[areas >= SPARE_AREA * hand.min_contact_area]
    faces, ends = grasp_class.kind == "faces", depths[np.argmax(areas >= areas.max() - 1e-12)]
    thin = faces and (not len(enough) or ends < enough[0] + BELOW_M)
    shallow = [float(depth) for depth in barely[:1] if thin and depth not in enough[:1]]
    least = [float(depth) + (0.0 if faces else SPARE_DEPTH_M) for depth in enough[:1]]
    return [*shallow, *least, *(depth + DEEPER_M for depth in least if depth + DEEPER_M < hand.finger_length)]


def _outline_edges(polygon: shapely.Polygon) -> list[NDArray]:
    """The outer edges (2, 2) of a polygon, the inside on their left."""
    ring = shapely.get_coordinates(shapely.orient_polygons(polygon).exterior)
    return [ring[k : k + 2].copy() for k in range(len(ring) - 1) if np.linalg.norm(ring[k + 1] - ring[k]) > LEAST_EDGE_M]
