"""The grasp–placement table (Handey 1987 §5.3, after Tournassoud, Lozano-Pérez and Mazer 1987): which grasp fits which placement.

It belongs to a part and a hand alone, so it outlives every change of the scene.
"""

from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.geometry.transforms import inverse
from handey_studio.grasping.classes import contact_areas, hand_in_plane
from handey_studio.grasping.groups import GraspGroup, grasp_groups
from handey_studio.grasping.placements import Placement, PlacementOptions, stable_placements
from handey_studio.grasping.rotations import HAND_MARGIN_M, GraspEnd, tilt
from handey_studio.world import Hand, Part
from handey_studio.world.collision import collision_model
from handey_studio.world.collision_queries import least_clearance
from handey_studio.world.gjk import distance


@dataclass(frozen=True)
class TableOptions:
    """Hand angles of a group's columns: `steps` to each side of crossing its edge at right angles, as far as `reach` [rad]. How far [m] the
    open hand stays above the plane, which is more than a depth map of a table is noisy by, and from the part itself."""

    reach: float = float(np.deg2rad(60.0))
    steps: int = 4
    least_height: float = 0.002
    least_gap: float = HAND_MARGIN_M
    placements: PlacementOptions = field(default_factory=PlacementOptions)


@dataclass(frozen=True, eq=False)
class GraspPlacementTable(Value):
    """Rows: placements; columns: grasps, which are groups with a hand angle.

    `placements` each once; row r is `placements[placement_of[r]]` standing as `Ts_plane_part[r]` (4, 4): a symmetric part has a row for
    each way of naming its faces. Column c is `groups[group_of[c]]` at `angles[c]` [rad], the hand at `Ts_part_hand[c]` (4, 4) open by
    `openings[c]` [m] (`hand_in_plane` with side 1). Of each column `areas` [m²] of contact with each face and `gaps` [m] from the open hand
    to the part itself; of each cell (r, c) `heights` [m] of the open hand's lowest corner above the plane and `tilts` [rad] of the fingers
    off straight down.
    """

    part: Part
    hand: Hand
    options: TableOptions
    placements: tuple[Placement, ...]
    placement_of: NDArray
    Ts_plane_part: NDArray
    groups: tuple[GraspGroup, ...]
    group_of: NDArray
    angles: NDArray
    Ts_part_hand: NDArray
    openings: NDArray
    areas: NDArray
    gaps: NDArray
    heights: NDArray
    tilts: NDArray

    def __post_init__(self) -> None:
        for key in ("placement_of", "group_of"):
            object.__setattr__(self, key, frozen_array(getattr(self, key), int))
        for key in ("Ts_plane_part", "angles", "Ts_part_hand", "openings", "areas", "gaps", "heights", "tilts"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))

    @cached_property
    def sound(self) -> NDArray:
        """Whether each column (c,) is a grasp at all: enough contact, and the open hand clear of the part."""
        return frozen_array((self.areas >= self.hand.min_contact_area) & (self.gaps >= self.options.least_gap), bool)

    @cached_property
    def legal(self) -> NDArray:
        """Whether each cell (r, c) is a grasp that the plane leaves room for."""
        return frozen_array(self.sound & (self.heights >= self.options.least_height), bool)

    def grasp_name(self, column: int) -> str:
        """A column in words: its group, and the hand's angle off crossing the group's edge at right angles."""
        group = self.groups[self.group_of[column]]
        return f"{group.name}, hand at {np.rad2deg(self.angles[column] - group.angle):+.0f}°"

    def reason(self, row: int, column: int) -> tuple[str, float, float, str]:
        """Why a cell is not legal: words, the number, the limit and their unit; no words if it is."""
        if self.areas[column] < self.hand.min_contact_area:
            return "the fingers overlap the face too little", float(self.areas[column]), self.hand.min_contact_area, "m²"
        if self.gaps[column] < self.options.least_gap:
            return "the open hand collides with the part itself", float(self.gaps[column]), self.options.least_gap, "m"
        words = "" if self.legal[row, column] else "the hand would reach into the table"
        return words, float(self.heights[row, column]), self.options.least_height, "m"


@lru_cache(maxsize=32)
def grasp_placement_table(part: Part, hand: Hand, options: TableOptions = TableOptions()) -> GraspPlacementTable:
    """The table of a part and a hand, kept in this process. Without a stable placement it has no rows, without a grasp no columns."""
    placements, _ = stable_placements(part, options.placements)
    groups, _ = grasp_groups(part, hand)
    poses = [(k, T) for k, placement in enumerate(placements) for T in placement.Ts_plane_part]
    Ts_plane_part = np.array([T for _, T in poses]).reshape(-1, 4, 4)
    offsets = np.linspace(-options.reach, options.reach, 2 * options.steps + 1)
    columns = [(g, group.angle + offset) for g, group in enumerate(groups) for offset in offsets]
    Ts_part_hand = np.array([_hand_at(groups[g], angle) for g, angle in columns]).reshape(-1, 4, 4)
    openings = np.array([groups[g].opening(hand) for g, _ in columns])
    heights, tilts = _above_plane(Ts_plane_part, Ts_part_hand, hand, openings)
    return GraspPlacementTable(
        part,
        hand,
        options,
        placements,
        np.array([k for k, _ in poses], dtype=int),
        Ts_plane_part,
        groups,
        np.array([g for g, _ in columns], dtype=int),
        np.array([angle for _, angle in columns]),
        Ts_part_hand,
        openings,
        np.concatenate([np.empty(0), *(_areas(group, hand, group.angle + offsets) for group in groups)]),
        _gaps(part, hand, Ts_part_hand, openings),
        heights,
        tilts,
    )


def legal_at(table: GraspPlacementTable, end: GraspEnd, margin: float = HAND_MARGIN_M) -> NDArray:
    """Which columns (c,) of the table are legal grasps at one end of a MOVE: the open hand keeps `margin` [m] from everything there."""
    model = collision_model(end.world)
    bodies, scene, T_hand_last = model.bodies(None, hand_only=True), model.scene(None, ()), inverse(model.arm.T_last_hand)
    legal, poses = np.zeros(len(table.angles), dtype=bool), np.zeros((model.arm.n + 1, 4, 4))
    for c in np.nonzero(table.sound)[0]:
        poses[-1] = end.T_world_part @ table.Ts_part_hand[c] @ T_hand_last
        corners = bodies.place(poses, float(table.openings[c])).corners
        legal[c] = least_clearance(bodies.shapes, corners, scene, margin)[0] >= margin  # how deep it collides does not matter here
    return legal


def tilts_at(table: GraspPlacementTable, T_world_part: NDArray) -> NDArray:
    """Tilts (c,) [rad] of the fingers off straight down in every column with the part at a pose."""
    return np.array([tilt(T) for T in T_world_part @ table.Ts_part_hand])


def _hand_at(group: GraspGroup, angle: float) -> NDArray:
    """T_part_hand (4, 4)."""
    return group.grasp_class.T_part_plane @ hand_in_plane(group.point, angle, 1)


def _areas(group: GraspGroup, hand: Hand, angles: NDArray) -> NDArray:
    """Areas (k,) [m²] of contact at each hand angle."""
    return contact_areas(group.grasp_class, hand, np.tile(group.point, (len(angles), 1)), angles)


def _hand_corners(hand: Hand, openings: NDArray) -> NDArray:
    """Corners (c, boxes, 8, 3) [m] of the hand's boxes in its own frame at each opening."""
    pick = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=bool)
    closed, apart = (np.array([np.where(pick, high, low) for low, high in hand.boxes(opening).values()]) for opening in (0.0, 1.0))
    return closed + openings[:, None, None, None] * (apart - closed)


def _above_plane(Ts_plane_part: NDArray, Ts_part_hand: NDArray, hand: Hand, openings: NDArray) -> tuple[NDArray, NDArray]:
    """Heights (r, c) [m] of the hand's lowest corner and tilts (r, c) [rad] of the fingers."""
    corners = _hand_corners(hand, openings)
    in_part = np.einsum("cij,cbkj->cbki", Ts_part_hand[:, :3, :3], corners) + Ts_part_hand[:, None, None, :3, 3]
    lowest = np.array([(in_part @ T[2, :3]).min(axis=(1, 2)) + T[2, 3] for T in Ts_plane_part])
    lowest = lowest.reshape(len(Ts_plane_part), len(openings))
    down = np.einsum("rj,cj->rc", Ts_plane_part[:, 2, :3], Ts_part_hand[:, :3, 2])
    return lowest, np.arccos(np.clip(-down, -1.0, 1.0))


def _gaps(part: Part, hand: Hand, Ts_part_hand: NDArray, openings: NDArray) -> NDArray:
    """Distances (c,) [m] between the open hand and the part; 0 where they meet."""
    first = np.cumsum([0] + [len(piece) for piece in part.pieces])
    return _least_gaps(_hand_corners(hand, openings), np.concatenate(part.pieces), first, inverse(Ts_part_hand))


@njit(cache=True)
def _least_gaps(boxes: NDArray, corners: NDArray, first: NDArray, Ts_hand_part: NDArray) -> NDArray:
    """Least distance (c,) [m] between the boxes (c, b, 8, 3) of a hand and the convex pieces of `corners`, each column at its own pose."""
    least = np.full(len(boxes), np.inf)
    moved = np.empty(corners.shape)
    for c in range(len(boxes)):
        T = Ts_hand_part[c]
        for k in range(len(corners)):
            for axis in range(3):
                moved[k, axis] = T[axis, 0] * corners[k, 0] + T[axis, 1] * corners[k, 1] + T[axis, 2] * corners[k, 2] + T[axis, 3]
        for b in range(boxes.shape[1]):
            box = boxes[c, b]
            for piece in range(len(first) - 1):
                gap = distance(box, 0, 8, moved, first[piece], first[piece + 1], least[c])
                least[c] = min(least[c], gap)
    return least
