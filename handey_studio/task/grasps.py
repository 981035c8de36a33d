"""The first two tests of an option: the hand angles that are legal at both ends, and the way in (Handey 1987 §5.1, §5.2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Posture, Value, frozen_array
from handey_studio.geometry.transforms import inverse
from handey_studio.grasping import (
    HAND_MARGIN_M,
    BumpRun,
    GraspGroup,
    GraspPlane,
    LegalRotations,
    contact_area,
    fill_grasp_plane,
    hand_in_plane,
    opening_around,
    plan_approach,
    tilt,
)
from handey_studio.task.options import Option
from handey_studio.task.plan import GraspChoice
from handey_studio.world import FINGERS, Hand
from handey_studio.world.collision import collision_model

STANDOFFS_M = (0.08, 0.05)  # the approach starts with the fingertips this far in front of the grasp point
CLOSED_MARGIN_M = 1e-4  # fingers that close on a part keep this from all else; what stands beside the part is that near


@dataclass(frozen=True)
class Fall:
    """Why an option fell, as the ledger tells it."""

    reason: str
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    bodies: tuple[str, ...] = ()
    posture: Posture | None = None


@dataclass(frozen=True, eq=False)
class Grasp(Value):
    """A grasp that can be approached: hand poses at both ends and the way in. `approach_hands` (k, 4, 4) ends at the pickup."""

    option: Option
    choice: GraspChoice
    approach: BumpRun
    approach_hands: NDArray
    retreat_hands: NDArray
    entry: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "approach_hands", frozen_array(self.approach_hands))
        object.__setattr__(self, "retreat_hands", frozen_array(self.retreat_hands))

    @property
    def T_world_hand_pickup(self) -> NDArray:
        return self.approach_hands[-1]

    @property
    def T_world_hand_putdown(self) -> NDArray:
        return self.retreat_hands[0]


def hand_posture(option: Option, T_world_hand: NDArray, opening: float, end: int) -> Posture:
    """The hand alone at one end (0 pickup, 1 putdown) of an option."""
    T_world_part = option.T_world_start if end == 0 else option.goal.T_world_goal
    return Posture((), plain(T_world_hand), opening, option.goal.instance.name, plain(T_world_part))


def plain(T: NDArray) -> tuple[float, ...]:
    return tuple(np.asarray(T, dtype=float).ravel().tolist())


def fall_illegal(option: Option, rotations: LegalRotations, entry: int, ledger: Ledger) -> None:
    """Say what forbids the group: too little contact, the part itself, one end, or each end some angles but never both the same."""
    fault = rotations.fault()
    if fault is None:
        return
    end = 1 if fault.end == "putdown" else 0
    T_world_hand = (option.pickup, option.putdown)[end].hand_pose(option.group, fault.angle)
    posture = hand_posture(option, T_world_hand, option.opening, end)
    ledger.fall(entry, fault.reason, value=fault.value, limit=fault.limit, unit="rad", bodies=fault.bodies, posture=posture)


def grasp_plane_of(option: Option) -> GraspPlane:
    """The grasp plane at the pickup, filled with everything that the world believes."""
    group, hand = option.group, option.goal.at_start.robot.hand
    T_world_plane = option.T_world_start @ group.grasp_class.T_part_plane
    return fill_grasp_plane(option.goal.at_start, T_world_plane, group.point, hand, option.opening)


@dataclass(frozen=True, eq=False)
class Approach(Value):
    """The way in to a grasp group at the pickup from one hand angle: the bump-line run, the contact area [m²] where it ends, and why it
    does not do, None if it does. It does not depend on where the part goes."""

    run: BumpRun
    area: float
    fell: Fall | None

    @property
    def final(self) -> NDArray:
        """Fingertip point y, z [m] and angle [rad] in the grasp plane where the run ends."""
        return self.run.path[-1]


def approach_at(option: Option, plane: GraspPlane, angle: float) -> Approach:
    """The approach of an option from one hand angle."""
    hand, group = option.goal.at_start.robot.hand, option.group
    run = approach_run(plane, group, hand, angle)
    final = run.path[-1]
    T_world_hand = option.T_world_start @ group.grasp_class.T_part_plane @ hand_in_plane(final[:2], final[2], 1)
    posture = hand_posture(option, T_world_hand, option.opening, 0)
    area = contact_area(group.grasp_class, hand, final[:2], final[2])
    if run.status != "reached":
        reason = {"stuck": "the approach got stuck", "iterations": "the approach ran out of steps"}
        words = reason.get(run.status, "the way in starts blocked")
        return Approach(run, area, Fall(words, run.distance, run.threshold, "m", posture=posture))
    if area < hand.min_contact_area:
        words = "the fingers overlap the face too little after the approach"
        return Approach(run, area, Fall(words, area, hand.min_contact_area, "m²", posture=posture))
    return Approach(run, area, _blocked(option, T_world_hand, 0))


def grasps_at(option: Option, rotations: LegalRotations, approach: Approach, entry: int, ledger: Ledger) -> list[Grasp]:
    """The grasps at the end of an approach, one for each way round of the hand; none if it falls."""
    final, T_part_plane = approach.final, option.group.grasp_class.T_part_plane
    fell = approach.fell or _blocked(option, option.goal.T_world_goal @ T_part_plane @ _straight_back(final, 1)[0], 1)
    if fell is not None:
        ledger.fall(entry, fell.reason, value=fell.value, limit=fell.limit, unit=fell.unit, bodies=fell.bodies, posture=fell.posture)
        return []
    found = []
    for side in (1, -1):
        in_plane = np.array([hand_in_plane(pose[:2], pose[2], side) for pose in approach.run.path])
        hands = option.T_world_start @ T_part_plane @ in_plane
        retreat = option.goal.T_world_goal @ T_part_plane @ _straight_back(final, side)
        choice = _choice(option, rotations, final, T_part_plane @ in_plane[-1], (tilt(hands[-1]), tilt(retreat[0])), approach.area)
        turned = ledger.add("hand", "one way round" if side > 0 else "the other way round", parent=entry)
        found.append(Grasp(option, choice, approach.run, hands, retreat, turned))
    return found


def approach_run(plane: GraspPlane, group: GraspGroup, hand: Hand, angle: float) -> BumpRun:
    """The bump-line planner's run with the hand at first at an angle, from as far out as the way in is free."""
    along = np.array([np.cos(angle), np.sin(angle)])
    runs = []
    for standoff in STANDOFFS_M:
        start = np.append(group.point - (standoff + group.depth) * along, angle)
        runs.append(plan_approach(plane, hand, start, group.point))
        if runs[-1].status == "reached":
            return runs[-1]
    return min(runs, key=lambda run: run.distance)


def finger_pairs(name: str) -> tuple[tuple[str, str], ...]:
    """The fingers may touch the part that they take."""
    return tuple((finger, name) for finger in FINGERS)


def _blocked(option: Option, T_world_hand: NDArray, end: int) -> Fall | None:
    """What the hand meets at one end (0 pickup, 1 putdown) where the approach has led it, open around the part or closed on it."""
    goal, width, where = option.goal, option.group.grasp_class.width, ("pickup", "putdown")[end]
    model = collision_model((goal.at_start, goal.at_goal)[end])
    tries = (("open", option.opening, (), HAND_MARGIN_M), ("closed", width, finger_pairs(goal.instance.name), CLOSED_MARGIN_M))
    for how, apart, pairs, margin in tries:
        clearance = model.hand_contact(T_world_hand, apart, allowed=pairs)
        if clearance.distance < margin:
            posture = hand_posture(option, T_world_hand, apart, end)
            return Fall(f"the {how} hand collides at the {where}", clearance.distance, margin, "m", clearance.bodies, posture)
    return None


def _straight_back(final: NDArray, side: int) -> NDArray:
    """T_plane_hand (k, 4, 4) of the retreat: straight back along the fingers."""
    along = np.array([np.cos(final[2]), np.sin(final[2])])
    return np.array([hand_in_plane(final[:2] - back * along, final[2], side) for back in np.linspace(0.0, STANDOFFS_M[0], 17)])


def _choice(
    option: Option, rotations: LegalRotations, final: NDArray, T_part_hand: NDArray, tilts: tuple[float, float], area: float
) -> GraspChoice:
    group, hand = option.group, option.goal.at_start.robot.hand
    T_part_plane = group.grasp_class.T_part_plane
    return GraspChoice(
        name=group.grasp_class.name,
        faces=group.grasp_class.faces,
        group=group.name,
        T_hand_part=inverse(T_part_hand),
        T_part_plane=T_part_plane,
        edge_part=_in_part(T_part_plane, group.edge),
        contact_part=_in_part(T_part_plane, group.grasp_class.outline),
        angle=float(final[2]),
        ranges=np.array(rotations.ranges()).reshape(-1, 2),
        tilts=tilts,
        width=group.grasp_class.width,
        opening=opening_around(hand, group.grasp_class.width),
        contact_area=area,
        joint_margin=0.0,
    )


def _in_part(T_part_plane: NDArray, points: NDArray) -> NDArray:
    return points @ T_part_plane[:3, 1:3].T + T_part_plane[:3, 3]
