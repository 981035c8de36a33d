"""The first two tests of an option: the hand angles that are legal at both ends, and the way in (Handey 1987 §5.1, §5.2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Posture, Value, frozen_array
from handey_studio.geometry.transforms import inverse
from handey_studio.grasping import (
    HAND_MARGIN_M,
    BumpRun,
    GraspPlane,
    Grip,
    LegalRotations,
    contact_area,
    fill_grasp_plane,
    gravity_in_hand,
    grip_margin,
    hand_in_plane,
    pad_wrenches,
    plan_grasp_motion,
    plan_retreat,
    tilt,
)
from handey_studio.task.options import Option
from handey_studio.task.plan import GraspChoice
from handey_studio.world import FINGERS
from handey_studio.world.collision import collision_model

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
    """A grasp that can be approached: hand poses at both ends and the way in. `approach_hands` (k, 4, 4) ends at the pickup,
    `retreat_hands` (m, 4, 4) begins at the putdown. `side` tells the hand's two ways round apart, as in `hand_in_plane`."""

    option: Option
    choice: GraspChoice
    approach: BumpRun
    approach_hands: NDArray
    retreat_hands: NDArray
    side: int
    entry: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "approach_hands", frozen_array(self.approach_hands))
        object.__setattr__(self, "retreat_hands", frozen_array(self.retreat_hands))

    @property
    def hands_at(self) -> tuple[NDArray, NDArray]:
        """The hand (4, 4) at the pickup and at the putdown."""
        return self.approach_hands[-1], self.retreat_hands[0]

    @property
    def parts_at(self) -> tuple[NDArray, NDArray]:
        """The part (4, 4) there."""
        return self.option.T_world_start, self.option.goal.T_world_goal


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


def grasp_plane_at(option: Option, end: int) -> GraspPlane:
    """The grasp plane at one end (0 pickup, 1 putdown), filled with everything that the world believes."""
    group, goal = option.group, option.goal
    world, T_world_part = ((goal.at_start, option.T_world_start), (goal.at_goal, goal.T_world_goal))[end]
    return fill_grasp_plane(world, T_world_part @ group.grasp_class.T_part_plane, group.point, world.robot.hand, option.opening)


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


NO_WAY_IN = {
    "stuck": "the approach got stuck",
    "iterations": "the approach ran out of steps",
    "blocked start": "the way in starts blocked",
    "short contact": "the fingers overlap the face too little after the approach",
    "no way": "there is no way in, by search of all motions in the grasp plane",
}


def approach_at(option: Option, plane: GraspPlane, angle: float, ranges: NDArray) -> Approach:
    """The approach of an option from one hand angle; `ranges` (m, 2) [rad] are the angles that are legal at the pickup."""
    hand, group = option.goal.at_start.robot.hand, option.group
    run = plan_grasp_motion(plane, hand, group, angle, ranges)
    final = run.path[-1]
    T_world_hand = option.T_world_start @ group.grasp_class.T_part_plane @ hand_in_plane(final[:2], final[2], 1)
    posture = hand_posture(option, T_world_hand, option.opening, 0)
    area = contact_area(group.grasp_class, hand, final[:2], final[2])
    if run.status == "reached":
        return Approach(run, area, _blocked(option, T_world_hand, 0))
    if run.status == "short contact":
        return Approach(run, area, Fall(NO_WAY_IN[run.status], area, hand.min_contact_area, "m²", posture=posture))
    return Approach(run, area, Fall(NO_WAY_IN[run.status], run.distance, run.threshold, "m", posture=posture))


def grasps_at(
    option: Option, rotations: LegalRotations, approach: Approach, putdown: GraspPlane, entry: int, ledger: Ledger
) -> list[Grasp]:
    """The grasps at the end of an approach, one for each way round of the hand; none if it falls. `putdown` is the grasp plane there."""
    T_part_plane, hand = option.group.grasp_class.T_part_plane, option.goal.at_start.robot.hand
    final = approach.final
    T_part_hand = T_part_plane @ hand_in_plane(final[:2], final[2], 1)
    ends = option.T_world_start @ T_part_hand, option.goal.T_world_goal @ T_part_hand
    fell = approach.fell or _blocked(option, ends[1], 1)
    grip = grip_of(option, T_part_hand, gravity_in_hand(np.array(ends)))
    fell = fell or slipping(grip, hand_posture(option, ends[0], option.opening, 0))
    out = plan_retreat(putdown, hand, final) if fell is None else None
    if out is not None and out.status != "reached":
        fell = Fall("the hand finds no way out at the putdown", out.distance, out.threshold, "m",
                    posture=hand_posture(option, ends[1], option.opening, 1))  # fmt: skip
    if fell is not None or out is None:
        _tell(fell, entry, ledger)
        return []
    found = []
    for side in (1, -1):
        hands, back = (
            T @ T_part_plane @ np.array([hand_in_plane(pose[:2], pose[2], side) for pose in path])
            for T, path in ((option.T_world_start, approach.run.path), (option.goal.T_world_goal, out.path))
        )
        choice = _choice(option, rotations, approach, inverse(option.T_world_start) @ hands[-1], (tilt(hands[-1]), tilt(back[0])), grip)
        turned = ledger.add("hand", "one way round" if side > 0 else "the other way round", parent=entry)
        found.append(Grasp(option, choice, approach.run, hands, back, side, turned))
    return found


def grip_of(option: Option, T_part_hand: NDArray, down_hand: NDArray) -> Grip:
    """How well the fingers hold the part at the worst of directions of gravity (n, 3) in the hand's frame."""
    group, goal = option.group, option.goal
    pads = pad_wrenches(group.grasp_class, goal.instance.part, goal.at_start.robot.hand, plain(inverse(T_part_hand)))
    return grip_margin(pads, down_hand)


def slipping(grip: Grip, posture: Posture) -> Fall | None:
    """Why a grip does not hold the part's weight, None if it does."""
    if grip.holds:
        return None
    if grip.force_margin < 0:
        return Fall(f"the part {grip.limit} in the fingers", grip.force_margin, 0.0, "N", posture=posture)
    return Fall(f"the part {grip.limit} in the fingers", grip.torque_margin, 0.0, "N m", posture=posture)


def _tell(fell: Fall | None, entry: int, ledger: Ledger) -> None:
    if fell is not None:
        ledger.fall(entry, fell.reason, value=fell.value, limit=fell.limit, unit=fell.unit, bodies=fell.bodies, posture=fell.posture)


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


def _choice(
    option: Option, rotations: LegalRotations, approach: Approach, T_part_hand: NDArray, tilts: tuple[float, float], grip: Grip
) -> GraspChoice:
    group = option.group
    T_part_plane = group.grasp_class.T_part_plane
    return GraspChoice(
        name=group.grasp_class.name,
        faces=group.grasp_class.faces,
        group=group.name,
        T_hand_part=inverse(T_part_hand),
        T_part_plane=T_part_plane,
        edge_part=_in_part(T_part_plane, group.edge),
        contact_part=_in_part(T_part_plane, group.grasp_class.outline),
        angle=float(approach.final[2]),
        ranges=np.array(rotations.ranges()).reshape(-1, 2),
        tilts=tilts,
        width=group.grasp_class.width,
        opening=option.opening,
        contact_area=approach.area,
        joint_margin=0.0,
        grip=grip,
        forbidden=rotations.forbidden,
    )


def _in_part(T_part_plane: NDArray, points: NDArray) -> NDArray:
    return points @ T_part_plane[:3, 1:3].T + T_part_plane[:3, 3]
