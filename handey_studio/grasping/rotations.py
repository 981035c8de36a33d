"""Legal rotations of the hand about a grasp point, at pickup and putdown together (Handey 1987 §5.1, Figures 7 and 8)."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.grasping.angle_ranges import Ranges, complement, inside, joined
from handey_studio.grasping.classes import contact_areas, hand_in_plane
from handey_studio.grasping.forbidden_angles import MOST_RANGES
from handey_studio.grasping.groups import GraspGroup
from handey_studio.grasping.plane_columns import add_columns, depth_columns
from handey_studio.grasping.plane_obstacles import Volumes, add_solids, hand_volumes
from handey_studio.world import Hand, Part, PlacedPart, World
from handey_studio.world.collision import ALLOWED_DEPTH_M, collision_model
from handey_studio.world.collision_bodies import Obstacles, obstacles_of

REACH_RAD = np.deg2rad(60.0)  # a group's directions: this far to each side of crossing its edge at right angles
STEP_RAD = np.deg2rad(7.5)
CONTACT_STEP_RAD = np.deg2rad(2.0)  # contact is looked at this often; between two angles it is forbidden unless enough at both
INSET_RAD = np.deg2rad(2.0)  # chosen angles stay this far from the ends of their range, if it is wide enough
HAND_MARGIN_M = 0.001  # the open hand keeps this far from everything when it stands at the grasp

End = Literal["pickup", "putdown", "both"]
ENDS: tuple[End, End] = ("pickup", "putdown")


@dataclass(frozen=True, eq=False)
class GraspEnd(Value):
    """One end of the part's motion: the world there with the part in it, and the part's pose."""

    world: World
    T_world_part: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_part", frozen_array(self.T_world_part))

    def hand_pose(self, group: GraspGroup, angle: float, side: int = 1) -> NDArray:
        """T_world_hand (4, 4) of the grasp at this end."""
        return self.T_world_part @ group.grasp_class.T_part_plane @ hand_in_plane(group.point, angle, side)

    @cached_property
    def own(self) -> PlacedPart | None:
        """The part itself as the world knows it: what stands at the pose, under one of its symmetries; None when nothing does."""
        for placed in self.world.parts:
            if np.abs(placed.T_world_part @ placed.part.symmetries - self.T_world_part).max(axis=(1, 2)).min() < 1e-6:
                return placed
        return None


@dataclass(frozen=True)
class ForbiddenRange:
    """Hand angles `low` to `high` [rad] of a group that are forbidden at one end of the motion or at both, and by what.

    `body` is the obstacle that the hand would meet, open, closed, or on its way between; nothing ("") where the fingers would touch too
    little of the part, and where the arm has no branch within its joint limits (`within_reach`).
    """

    low: float
    high: float
    end: End
    body: str
    what: Literal["obstacle", "contact", "reach"] = "obstacle"


@dataclass(frozen=True)
class RotationFault:
    """Why no hand angle is left: `value` [rad] of the group's angles are forbidden, of `limit` [rad], at one end or at both.

    `bodies` forbid the most upright of the group's angles, `angle` [rad].
    """

    reason: str
    value: float
    limit: float
    bodies: tuple[str, ...]
    end: End
    angle: float


@dataclass(frozen=True, eq=False)
class LegalRotations(Value):
    """The hand angles that a group has at pickup and putdown together: those from `low` to `high` [rad] that nothing forbids.

    `uprights` (2, 2) are the heights, at pickup and putdown, of the grasp plane's y and z directions: they tell the fingers' tilt.
    """

    group: GraspGroup
    low: float
    high: float
    forbidden: tuple[ForbiddenRange, ...]
    uprights: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "uprights", frozen_array(self.uprights))

    @property
    def legal(self) -> bool:
        """Whether any angle is left."""
        return bool(self.ranges())

    @property
    def shut_by_bodies(self) -> bool:
        """Whether what stands at the ends forbids angles, so that less room for the hand may do."""
        return any(f.body and f.end != "both" for f in self.forbidden)

    def ranges(self, end: End = "both") -> Ranges:
        """The free ranges (first, last) [rad] in order, at one end alone or at both together."""
        return complement(
            joined([(f.low, f.high) for f in self.forbidden if end in ("both", f.end) or f.end == "both"]), self.low, self.high
        )

    def tilts(self, angles: NDArray) -> NDArray:
        """Tilts (k, 2) [rad] of the fingers off straight down at pickup and putdown for hand angles (k,) [rad]."""
        along = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        return np.arccos(np.clip(-along @ self.uprights.T, -1.0, 1.0))

    def candidates(self) -> list[float]:
        """Legal angles worth a look, those with the fingers most vertical over both ends first."""
        ranges = self.ranges()
        downs = np.arctan2(-self.uprights[:, 1], -self.uprights[:, 0])
        wanted = np.array([self.group.angle, *downs, self.group.angle + np.angle(np.exp(1j * (downs - self.group.angle)).sum())])
        steps = np.arange(self.low, self.high + 1e-9, STEP_RAD)
        angles = np.unique([inside(angle, ranges, INSET_RAD) for angle in (*wanted, *steps)] if ranges else [])
        return angles[np.argsort(self.tilts(angles).sum(axis=1), kind="stable")].tolist()

    def best(self, count: int, serves: Callable[[float], bool] = lambda _: True) -> list[float]:
        """The first `count` of the candidates that serve, well apart."""
        chosen: list[float] = []
        for angle in self.candidates():
            if len(chosen) < count and all(abs(angle - other) > 1.5 * STEP_RAD for other in chosen) and serves(angle):
                chosen.append(angle)
        return chosen

    def fault(self) -> RotationFault | None:
        """Why no angle is left, if none is."""
        contact = [f for f in self.forbidden if f.what == "contact"]
        met = [f for f in self.forbidden if f.what != "reach"]
        own = [f for f in met if f.end == "both"]
        stages: list[tuple[str, End, list[ForbiddenRange]]] = [
            ("the fingers would touch too little of the part at every angle", "both", contact),
            ("the part itself is in the hand's way at every angle", "both", own),
            *((f"the hand collides at every angle at the {end}", end, own + [f for f in met if f.end == end]) for end in ENDS),
            ("no hand angle is legal at pickup and putdown together", "both", met),
            *((f"the arm reaches no legal angle at the {end}", end, met + [f for f in self.forbidden if f.end == end]) for end in ENDS),
            ("the arm reaches no hand angle at pickup and putdown together", "both", list(self.forbidden)),
        ]
        angles, window = np.linspace(self.low, self.high, 61), self.high - self.low
        upright = float(angles[np.argmin(self.tilts(angles).sum(axis=1))])
        for words, end, ranges in stages:
            taken = float(sum(high - low for low, high in joined([(f.low, f.high) for f in ranges])))
            if taken >= window - 1e-9:
                bodies = tuple(dict.fromkeys(f.body for f in ranges if f.body and f.low <= upright <= f.high))
                return RotationFault(words, taken, window, bodies, end, upright)
        return None

    def bodies_at(self, angle: float, end: End) -> tuple[str, ...]:
        """What forbids an angle at one end."""
        return tuple(f.body for f in self.forbidden if f.end in (end, "both") and f.low <= angle <= f.high and f.body)


def tilt(T_world_hand: NDArray) -> float:
    """Angle [rad] between the fingers and straight down."""
    return float(np.arccos(np.clip(-T_world_hand[2, 2], -1.0, 1.0)))


def angle_range(group: GraspGroup) -> NDArray:
    """Hand angles (k,) [rad] all over the range that belongs to a group."""
    steps = round(REACH_RAD / STEP_RAD)
    return group.angle + np.arange(-steps, steps + 1) * STEP_RAD


def legal_rotations(group: GraspGroup, pickup: GraspEnd, putdown: GraspEnd) -> LegalRotations:
    """The angles at which the hand, about the group's point, is clear at both ends: open, closed on the part, and on its way between.

    Both ends' obstacles are looked at in the part's own frame: the putdown's are carried back by the inverse of the part's motion. The
    ranges are exact for convex bodies kept HAND_MARGIN_M away (squarely at the hand's corners), and for the depth map's columns made up
    to a millimetre larger. Contact is looked at every CONTACT_STEP_RAD.
    """
    hand, window = pickup.world.robot.hand, (group.angle - REACH_RAD, group.angle + REACH_RAD)
    own = pickup.own or putdown.own
    forbidden = list(_contact_ranges(group, hand))
    forbidden += _own_ranges(group, own.part, hand, own.name) if own else ()
    planes = [end.T_world_part @ group.grasp_class.T_part_plane for end in (pickup, putdown)]
    found = LegalRotations(group, *window, tuple(forbidden), np.array([T[2, 1:3] for T in planes]))
    if not found.legal:
        return found  # whatever the scene
    volumes = hand_volumes(hand, group.grasp_class.width, group.opening(hand), HAND_MARGIN_M)
    for name, end, T in zip(ENDS, (pickup, putdown), planes, strict=True):
        forbidden += [ForbiddenRange(low, high, name, body) for body, low, high in _end_ranges(end, T, group, volumes, window)]
    return replace(found, forbidden=tuple(forbidden))


def _end_ranges(
    end: GraspEnd, T_world_plane: NDArray, group: GraspGroup, volumes: Volumes, window: tuple[float, float]
) -> list[tuple[str, float, float]]:
    """Bodies and the angles [rad] that they forbid at one end."""
    model, world = collision_model(end.world), end.world
    at_point = T_world_plane @ _to_point(group)
    ranges, counts = np.empty((len(model.names), MOST_RANGES, 2)), np.zeros(len(model.names), np.int64)
    own = model.names.index(end.own.name) if end.own else -1
    add_solids(model.solids, own, at_point, volumes, window, ranges, counts)
    if world.terrain is not None:
        columns = depth_columns(world.terrain, world.table_z, float(world.free_space[1, 2]))
        add_columns(columns, at_point, volumes, window, ranges, counts, 0)
    return _told(ranges, counts, model.names)


@lru_cache(maxsize=4096)
def _own_ranges(group: GraspGroup, part: Part, hand: Hand, name: str) -> tuple[ForbiddenRange, ...]:
    """Where the part itself is in the hand's way: the same at both ends, whatever the scene."""
    volumes = hand_volumes(hand, group.grasp_class.width, group.opening(hand), HAND_MARGIN_M, ALLOWED_DEPTH_M)
    window = (group.angle - REACH_RAD, group.angle + REACH_RAD)
    ranges, counts = np.empty((1, MOST_RANGES, 2)), np.zeros(1, np.int64)
    add_solids(_pieces(part), -1, group.grasp_class.T_part_plane @ _to_point(group), volumes, window, ranges, counts)
    return tuple(ForbiddenRange(low, high, "both", name) for _, low, high in _told(ranges, counts, (name,)))


@lru_cache(maxsize=64)
def _pieces(part: Part) -> Obstacles:
    """The part's convex pieces in its own frame."""
    return obstacles_of([(part.name, np.array(piece)) for piece in part.pieces], {part.name: 0})


@lru_cache(maxsize=4096)
def _contact_ranges(group: GraspGroup, hand: Hand) -> tuple[ForbiddenRange, ...]:
    """Where the fingers would touch too little of the part, whatever the scene."""
    angles = group.angle + np.linspace(-REACH_RAD, REACH_RAD, 2 * round(REACH_RAD / CONTACT_STEP_RAD) + 1)
    areas = contact_areas(group.grasp_class, hand, np.tile(group.point, (len(angles), 1)), angles)
    enough = areas >= hand.min_contact_area
    short = ~(enough[:-1] & enough[1:])
    spans = joined(list(zip(angles[:-1][short], angles[1:][short], strict=True)))
    return tuple(ForbiddenRange(float(low), float(high), "both", "", "contact") for low, high in spans)


def _to_point(group: GraspGroup) -> NDArray:
    """The grasp plane's frame moved to the grasp point (4, 4)."""
    T = np.eye(4)
    T[1:3, 3] = group.point
    return T


def _told(ranges: NDArray, counts: NDArray, names: tuple[str, ...]) -> list[tuple[str, float, float]]:
    return [(names[b], float(low), float(high)) for b in np.nonzero(counts)[0] for low, high in sorted(ranges[b, : counts[b]].tolist())]
