"""How grasp groups are ranked (Handey 1987 §5.1): how vertical the fingers are, then clearance, contact area and joint margin."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.geometry.transforms import inverse
from handey_studio.grasping.classes import contact_area, finger_pads
from handey_studio.grasping.groups import GraspGroup
from handey_studio.grasping.rotations import GraspEnd, LegalRotations, angle_range
from handey_studio.world import Hand, Part
from handey_studio.world.collision import collision_model

ENOUGH_CLEARANCE_M = 0.010  # more clearance, contact or joint margin than this makes a grasp no better
ENOUGH_AREAS = 4.0  # times the least contact area
ENOUGH_MARGIN_RAD = float(np.deg2rad(30.0))
TILT_STEP_RAD = float(np.deg2rad(5.0))  # fingers whose tilt differs by less are as vertical as each other
CLEARANCE_COST, AREA_COST, MARGIN_COST = 0.08, 0.04, 0.02  # [rad] of tilt that none at all of each is worth
OFF_CENTRE_COST = 4.0  # [rad/m]: a grasp 10 cm off the centre of mass ranks like one tilted by 0.4 rad more


@dataclass(frozen=True)
class RankTerms:
    """What a group is ranked by; what is not known yet is None and counts as enough.

    `tilt` [rad] of the fingers off straight down, the sum of both ends; `off_centre` [m] of the contact from the part's centre of mass, in
    the grasp plane; `clearance` [m] of the open hand at the less free end; `contact` in least contact areas; `joint_margin` [rad] to the
    nearest joint limit.
    """

    tilt: float
    off_centre: float
    contact: float
    clearance: float | None = None
    joint_margin: float | None = None

    @property
    def costs(self) -> dict[str, float]:
        """What each term costs [rad of tilt], in the order in which they count."""
        return {
            "tilt": self.tilt,
            "off centre": OFF_CENTRE_COST * self.off_centre,
            "clearance": CLEARANCE_COST * _lack(self.clearance, ENOUGH_CLEARANCE_M),
            "contact": AREA_COST * _lack(self.contact, ENOUGH_AREAS),
            "joint margin": MARGIN_COST * _lack(self.joint_margin, ENOUGH_MARGIN_RAD),
        }

    @property
    def cost(self) -> float:
        """All of it [rad of tilt]: less is better."""
        return sum(self.costs.values())

    @property
    def key(self) -> tuple[float, ...]:
        """Sorts groups term by term, those first that are as vertical as can be: tilt in steps, then the others in turn."""
        costs = self.costs
        upright = costs.pop("tilt") + costs.pop("off centre")
        return (round(upright / TILT_STEP_RAD), *costs.values(), upright)


def rank_terms(
    group: GraspGroup,
    pickup: GraspEnd,
    putdown: GraspEnd,
    rotations: LegalRotations | None = None,
    angle: float | None = None,
    joint_margin: float | None = None,
) -> RankTerms:
    """What a group is ranked by, from its geometry alone, or at a legal angle [rad] (else the best one) of its rotations."""
    if rotations is None:
        own = pickup.own or putdown.own
        contact, off_centre = _at_group(group, own.part if own else None, pickup.world.robot.hand)
        return RankTerms(_least_tilt(group, pickup, putdown), off_centre, contact, None, joint_margin)
    best = rotations.best(1)
    chosen = angle if angle is not None else best[0] if best else group.angle
    terms = rank_terms(group, pickup, putdown)
    hand = pickup.world.robot.hand
    opening = group.opening(hand)
    ends = [(end, end.hand_pose(group, chosen)) for end in (pickup, putdown)]
    clearance = min(collision_model(end.world).hand_contact(T, opening, limit=ENOUGH_CLEARANCE_M).distance for end, T in ends)
    contact = contact_area(group.grasp_class, hand, group.point, chosen) / hand.min_contact_area
    return RankTerms(float(rotations.tilts(np.array([chosen])).sum()), terms.off_centre, contact, clearance, joint_margin)


def _lack(value: float | None, enough: float) -> float:
    """How much is missing to enough, from 0 to 1."""
    return 0.0 if value is None else float(np.clip(1.0 - value / enough, 0.0, 1.0))


def _least_tilt(group: GraspGroup, pickup: GraspEnd, putdown: GraspEnd) -> float:
    """Least sum [rad] of the fingers' tilts at both ends over the group's angles."""
    angles = angle_range(group)
    along = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    heights = [(end.T_world_part @ group.grasp_class.T_part_plane)[2, 1:3] for end in (pickup, putdown)]
    return float(np.arccos(np.clip(-along @ np.array(heights).T, -1.0, 1.0)).sum(axis=1).min())


@lru_cache(maxsize=4096)
def _at_group(group: GraspGroup, part: Part | None, hand: Hand) -> tuple[float, float]:
    """Contact in least contact areas, and how far [m] its middle is from the part's centre of mass, in the grasp plane."""
    pad: NDArray = finger_pads(hand, group.point[None], np.array([group.angle]))
    touched = shapely.centroid(shapely.intersection(pad, group.grasp_class.contact))
    area = contact_area(group.grasp_class, hand, group.point, group.angle) / hand.min_contact_area
    if part is None or shapely.is_empty(touched)[0]:
        return area, 0.0
    centre = (inverse(group.grasp_class.T_part_plane)[:3] @ np.append(part.solid.volume_and_centroid[1], 1.0))[1:]
    return area, float(np.linalg.norm(shapely.get_coordinates(touched)[0] - centre))
