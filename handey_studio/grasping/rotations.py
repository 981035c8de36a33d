"""Legal rotations of the hand about a grasp point, at pickup and putdown together (Handey 1987 §5.1, Figures 7 and 8)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.grasping.classes import GraspGroup, contact_area, hand_in_plane, opening_around
from handey_studio.world import World
from handey_studio.world.collision import collision_model

REACH_RAD = np.deg2rad(60.0)  # a group's directions: this far to each side of crossing its edge at right angles
STEP_RAD = np.deg2rad(7.5)
HAND_MARGIN_M = 0.001  # the open hand keeps this far from everything when it stands at the grasp


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


@dataclass(frozen=True, eq=False)
class LegalRotations(Value):
    """The hand angles (k,) [rad] that were looked at, and for each the open hand's clearance (k, 2) [m] at pickup and putdown.

    `blockers` names the closest pair of bodies (k, 2). `areas` (k,) [m²] of contact, `tilts` (k, 2) [rad] off straight down.
    """

    angles: NDArray
    clearances: NDArray
    blockers: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]
    areas: NDArray
    tilts: NDArray
    min_area: float

    def __post_init__(self) -> None:
        for key in ("angles", "clearances", "areas", "tilts"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))

    @property
    def legal_at(self) -> NDArray:
        """Whether each angle is legal (k, 2) at pickup and at putdown."""
        return np.logical_and(self.clearances >= HAND_MARGIN_M, (self.areas >= self.min_area)[:, None])

    @property
    def legal(self) -> NDArray:
        """Whether each angle is legal (k,) at both ends."""
        return np.asarray(self.legal_at.all(axis=1))

    def ranges(self) -> list[tuple[float, float]]:
        """Runs of neighbouring legal angles as (first, last) [rad]."""
        order = np.argsort(self.angles)
        runs: list[tuple[float, float]] = []
        for previous, k in zip(np.r_[-1, order[:-1]], order, strict=True):
            if not self.legal[k]:
                continue
            angle = float(self.angles[k])
            joined = previous >= 0 and self.legal[previous]
            runs = [*runs[:-1], (runs[-1][0], angle)] if joined else [*runs, (angle, angle)]
        return runs

    def best(self, count: int) -> list[float]:
        """Up to `count` legal angles with the fingers most vertical over both ends, at least two steps apart."""
        chosen: list[float] = []
        for k in np.argsort(self.tilts.sum(axis=1), kind="stable"):
            if self.legal[k] and all(abs(self.angles[k] - other) > 1.5 * STEP_RAD for other in chosen):
                chosen.append(float(self.angles[k]))
            if len(chosen) == count:
                break
        return chosen


def tilt(T_world_hand: NDArray) -> float:
    """Angle [rad] between the fingers and straight down."""
    return float(np.arccos(np.clip(-T_world_hand[2, 2], -1.0, 1.0)))


def angle_range(group: GraspGroup) -> NDArray:
    """The hand angles (k,) [rad] that belong to a group."""
    steps = round(REACH_RAD / STEP_RAD)
    return group.angle + np.arange(-steps, steps + 1) * STEP_RAD


def legal_rotations(group: GraspGroup, pickup: GraspEnd, putdown: GraspEnd) -> LegalRotations:
    """Try the group's range of hand angles at both ends.

    The paper carries the putdown's obstacles into the pickup's frame by the inverse of the part's motion and tests once; testing
    the carried hand among the putdown's obstacles where they are is the same test, and keeps their names.
    """
    hand = pickup.world.robot.hand
    opening = opening_around(hand, group.grasp_class.width)
    angles = angle_range(group)
    areas = np.array([contact_area(group.grasp_class, hand, group.point, angle) for angle in angles])
    clearances, tilts, blockers = np.full((len(angles), 2), np.inf), np.zeros((len(angles), 2)), []
    for k, angle in enumerate(angles):
        names: list[tuple[str, ...]] = [(), ()]
        for e, end in enumerate((pickup, putdown)):
            T_world_hand = end.hand_pose(group, angle)
            tilts[k, e] = tilt(T_world_hand)
            if areas[k] >= hand.min_contact_area:
                found = collision_model(end.world).hand_contact(T_world_hand, opening)
                clearances[k, e], names[e] = found.distance, tuple(found.bodies)
        blockers.append((names[0], names[1]))
    return LegalRotations(angles, clearances, tuple(blockers), areas, tilts, hand.min_contact_area)
