"""Checking a robot folder: everything that is wrong with it, one sentence each, and what is right."""

import os
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.base import BadInput
from handey_studio.world.arm import Arm, arm_of
from handey_studio.world.collision import always_touching, collision_model
from handey_studio.world.link_body import LinkBody
from handey_studio.world.robot_file import (
    RISE_S,
    TOOL_ACCELERATION_M_S2,
    TOOL_SPEED_M_S,
    read_table,
    robot_faults,
    robot_of,
    table_faults,
    unknown_keys,
)
from handey_studio.world.world import EVERYWHERE, NO_TABLE, World

POSTURES = 300
MUCH_AIR = 1.4  # a link whose pieces hold so many times its own volume is told
ROUNDING_RAD = np.deg2rad(0.1)  # limits that agree but for their decimals
SAME_RAD, SAME_M = 1e-5, 1e-8
CROWDED = 0.5


@dataclass(frozen=True)
class RobotReport:
    """One sentence each: what is `wrong`, so that the robot cannot be used; what had better be looked at; what is right."""

    wrong: tuple[str, ...]
    notes: tuple[str, ...] = ()
    right: tuple[str, ...] = ()


def check_robot(folder: str | os.PathLike) -> RobotReport:
    """Everything about a robot folder that can be told without using it. What is wrong early hides what may be wrong later."""
    try:
        path, table = read_table(folder)
        wrong = [f"robot.toml {fault}" for fault in table_faults(table)]
        notes = [
            f'robot.toml has the key "{key}", which means nothing; see robots/ur5/robot.toml for every key.' for key in unknown_keys(table)
        ]
        if wrong:
            return RobotReport(tuple(wrong), tuple(notes))
        robot = robot_of(table, path.parent)
        wrong = [f"robot.toml: {fault}" for fault in robot_faults(robot)]
        arm = arm_of(robot)
    except BadInput as error:
        return RobotReport((str(error),))
    wrong += [*_limit_faults(arm), *_body_faults(arm)]
    if wrong:
        return RobotReport(tuple(wrong), tuple(notes))
    posture_faults, posture_notes, clear = _postures(arm)
    ik_faults, solved = _inverse(arm)
    notes += [*_velocity_notes(arm), *_body_notes(arm), *posture_notes]
    return RobotReport((*posture_faults, *ik_faults), tuple(notes), (*_facts(arm), *clear, *solved))


def _limit_faults(arm: Arm) -> Iterator[str]:
    """Joint limits beyond those of the URDF."""
    robot = arm.robot
    for k, (low, high) in enumerate(zip(*_urdf_limits(arm), strict=True)):
        for end, own, limit, beyond in (
            ("lower", robot.lower[k], low, low - robot.lower[k]),
            ("upper", robot.upper[k], high, robot.upper[k] - high),
        ):
            if beyond > ROUNDING_RAD:
                yield (
                    f"limits.{end}_deg of {robot.joint_names[k]} is {np.rad2deg(own):g}°, beyond the URDF's {np.rad2deg(limit):.1f}°; "
                    f"the joint takes {np.rad2deg(low):.1f}° to {np.rad2deg(high):.1f}°."
                )


def _urdf_limits(arm: Arm) -> tuple[NDArray, NDArray]:
    """Least and greatest angle (n,) [rad] of each joint in the URDF; infinite for joints that turn on and on."""
    low, high = np.full(arm.n, -np.inf), np.full(arm.n, np.inf)
    for k in range(arm.n):
        joint = arm.model.joints[k + 1]
        if joint.nq == 1:
            low[k], high[k] = arm.model.lowerPositionLimit[joint.idx_q], arm.model.upperPositionLimit[joint.idx_q]
    return low, high


def _velocity_notes(arm: Arm) -> Iterator[str]:
    """Velocities beyond those of the URDF, which are often a guess."""
    robot, over = arm.robot, []
    for k in range(arm.n):
        fastest = float(arm.model.velocityLimit[arm.model.joints[k + 1].idx_v])
        if 0 < fastest * 1.02 < robot.velocity[k]:
            over.append(f"{robot.joint_names[k]} {np.rad2deg(robot.velocity[k]):g} ({np.rad2deg(fastest):.0f})")
    if over:
        yield f"limits.velocity_deg_s is more than the URDF's, in brackets: {', '.join(over)}; the URDF may be wrong."


def _body_faults(arm: Arm) -> Iterator[str]:
    """Links that nothing would keep from colliding, and names of bodies that are not there."""
    unknown = [name for name in arm.robot.ignored_bodies if name not in arm.body_names]
    if unknown:
        yield f"ignored_bodies names {unknown}, which the URDF lacks; choose among {list(arm.body_names)}."
    carried = {body.link for body in arm.bodies}
    for k, joint in enumerate(arm.robot.joint_names[:-1], 1):
        if k not in carried:
            yield f"the link that {joint} moves has no collision body, so nothing keeps it from colliding; give its link one in the URDF."


def _body_notes(arm: Arm) -> Iterator[str]:
    if not any(body.link == 0 for body in arm.bodies):
        yield "the base has no collision body; the arm may pass through where it stands."
    for body in arm.bodies:
        own, held = _volume(body), sum(float(ConvexHull(hull).volume) for hull in body.hulls)
        if held > MUCH_AIR * own:
            pieces = "convex hull holds" if len(body.hulls) == 1 else f"{len(body.hulls)} convex pieces hold"
            yield f"{body.name}'s {pieces} {1e3 * held:.2f} l, its mesh {1e3 * own:.2f} l; a closed mesh is cut into tighter pieces."
    pairs = sorted(" and ".join(sorted(pair)) for pair in always_touching(arm.robot))
    if pairs:
        yield f"these touch at every posture, so they are not checked against each other: {'; '.join(pairs)}."


def _volume(body: LinkBody) -> float:
    """Volume [m³] inside a body's mesh, of each of its closed surfaces for itself."""
    a, b, c = (body.vertices[body.triangles[:, k]] for k in range(3))
    return abs(float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum())) / 6.0


def _postures(arm: Arm) -> tuple[list[str], list[str], list[str]]:
    """Whether the arm meets itself: at home, and at how many postures drawn at random. What is wrong, worth a note, right."""
    robot = arm.robot
    model = collision_model(World(robot, NO_TABLE, free_space=EVERYWHERE))
    wrong, notes, right = [], [], []
    ends = [model.clearance(robot.home, opening) for opening in (robot.hand.opening_min, robot.hand.opening_max)]
    home = min(ends, key=lambda clearance: clearance.distance)
    if home.distance <= 0:
        wrong.append(f"at home_deg {home}; choose a home where the arm is clear of itself.")
    else:
        right.append(f"at home {home}, nearer than any other pair.")
    low = float(arm.link_poses(robot.home)[1:, 2, 3].min())
    if low < 0 or arm.hand_pose(robot.home)[2, 3] < 0:
        notes.append("at home a joint or the hand is below z = 0, where the table is unless the workcell says otherwise.")
    drawn = np.random.default_rng(0).uniform(robot.lower, robot.upper, (POSTURES, arm.n))
    meets = np.mean([model.in_contact(q, robot.hand.opening_min) is not None for q in drawn])
    if meets > CROWDED:
        notes.append(f"the arm meets itself at {100 * meets:.0f} % of all postures; its bodies may be too big, or its limits too wide.")
    else:
        right.append(f"{100 * (1 - meets):.0f} % of {POSTURES} postures drawn within the limits are clear of the arm itself.")
    return wrong, notes, right


def _inverse(arm: Arm) -> tuple[list[str], list[str]]:
    """Whether inverse kinematics finds postures drawn at random from the poses that they make."""
    robot = arm.robot
    drawn = np.random.default_rng(1).uniform(robot.lower, robot.upper, (POSTURES // 3, arm.n))
    try:
        found = sum(_found_again(arm, q) for q in drawn)
    except BadInput as error:
        return [str(error)], []
    told = f'ik = "{robot.ik}" finds {found} of {len(drawn)} drawn postures again from their poses'
    return ([], [f"{told}."]) if found >= 0.98 * len(drawn) else ([f"{told}; try another ik."], [])


def _found_again(arm: Arm, q: NDArray) -> bool:
    T = arm.hand_pose(q)
    branches = arm.ik(T, q[arm.robot.held_index])
    exact = branches[np.abs(arm.hand_pose(branches) - T).max(axis=(1, 2)) < SAME_M] if len(branches) else branches
    return bool((np.abs(np.mod(exact - q + np.pi, 2 * np.pi) - np.pi).max(axis=1) < SAME_RAD).any())


def _facts(arm: Arm) -> Iterator[str]:
    robot, hand = arm.robot, arm.robot.hand
    yield f"{arm.n} joints: {', '.join(robot.arm_joints)} span the configuration space, {', '.join(robot.wrist_joints)} turn the wrist."
    for name, values in zip(robot.held_joints, np.rad2deg(robot.held_values).T, strict=True):
        yield f"{name} is held at {', '.join(f'{value:g}°' for value in dict.fromkeys(values))}, tried in turn."
    rise = 1e3 * robot.acceleration / robot.jerk
    rises = f"{rise.min():.0f} ms" if np.ptp(rise) < 1.0 else f"{rise.min():.0f} to {rise.max():.0f} ms"
    yield f"the joints take {rises} to their full acceleration (limits.jerk_deg_s3, {1e3 * RISE_S:.0f} ms unless given)."
    yield (
        f"straight motions of the hand run at up to {robot.tool_speed:g} m/s and {robot.tool_acceleration:g} m/s² (limits.tool_speed_m_s, "
        f"{TOOL_SPEED_M_S:g} unless given, and limits.tool_acceleration_m_s2, {TOOL_ACCELERATION_M_S2:g})."
    )
    yield f"{len(arm.bodies)} collision bodies in {sum(len(body.hulls) for body in arm.bodies)} convex pieces."
    least, most, out = 1e3 * hand.opening_min, 1e3 * hand.opening_max, 1e3 * float(hand.T_flange_hand[2, 3])
    yield f"the hand opens from {least:g} to {most:g} mm, its fingertips are {out:g} mm from the flange."
