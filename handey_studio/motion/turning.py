"""Where the arm joints' hinges are, and which circles the balls of the arm run around them, with held joints within a range."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import inverse
from handey_studio.motion.circles import Circles
from handey_studio.motion.forbidden_ranges import Hinges
from handey_studio.motion.wrist_box import WristBox, gather, link_balls
from handey_studio.world import Robot, arm_of

GROUP_M = 0.15  # balls within a cube of this width are looked at together first
REACH_STEP_M = 0.25  # what is carried changes the reach in steps, so that one distance field serves most things held


@dataclass(frozen=True)
class Between:
    """Between which angles [rad] the held joints before the carrier stay; empty for arms of six joints."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]

    @staticmethod
    def of(robot: Robot, wrists: NDArray) -> "Between":
        """The range of the held joints on a way (m, joints − 3) of the joints other than the arm's."""
        mine = [k for k, joint in enumerate(robot.other_index) if joint < robot.carrier]
        return Between(tuple(wrists[:, mine].min(axis=0).tolist()), tuple(wrists[:, mine].max(axis=0).tolist()))

    def posture(self, robot: Robot) -> NDArray:
        """The configuration (n,) with the held joints amid their ranges and all others at zero."""
        q = np.zeros(len(robot.joint_names))
        q[robot.other_index[robot.other_index < robot.carrier]] = (np.array(self.lower) + np.array(self.upper)) / 2
        return q


def angle_table(angles: NDArray) -> NDArray:
    """Cosine and sine (n, 2)."""
    return np.column_stack([np.cos(angles), np.sin(angles)])


@lru_cache(maxsize=32)
def hinges_of(robot: Robot, held: Between) -> Hinges:
    """The hinges of the arm joints with the held joints amid their ranges."""
    arm, joints = arm_of(robot), robot.arm_index
    poses = arm.link_poses(held.posture(robot))
    before = [poses[joint] @ arm.T_links[joint] for joint in joints]
    turned = [poses[joint + 1] for joint in joints]
    second, third = inverse(turned[0]) @ before[1], inverse(turned[1]) @ before[2]
    return Hinges(np.array(before[0]), np.array(second), np.array(third), np.array(arm.axes[joints]))


@lru_cache(maxsize=64)
def link_circles(robot: Robot, stage: int, margin: float, held: Between, step: float) -> Circles:
    """The circles of the links that the arm joint number `stage`, 0 to 2, turns and the next one does not."""
    centres, radii, links = link_balls(robot)
    mine = np.searchsorted(robot.arm_index, links) == stage + 1
    poses = arm_of(robot).link_poses(held.posture(robot))
    T = (inverse(poses[robot.arm_index[stage] + 1]) @ poses)[links[mine]]
    placed = np.einsum("kij,kj->ki", T[:, :3, :3], centres[mine]) + T[:, :3, 3]
    return _circles(robot, stage, placed, radii[mine] + margin, _slack(robot, centres[mine], links[mine], held, step))


@lru_cache(maxsize=64)
def carried_circles(robot: Robot, box: WristBox, margin: float, held: Between, step: float) -> Circles:
    """The circles of what the wrist box holds, around the last arm joint."""
    links = np.full(len(box.radii), box.carrier)
    return _circles(robot, 2, box.centres, box.radii + margin, _slack(robot, box.centres, links, held, step))


def reach_of(robot: Robot, box: WristBox) -> float:
    """How far [m] at most, rounded up, anything of the arm gets from the base's origin."""
    centres, radii, links = link_balls(robot)
    own = links == box.carrier
    far = max(float((np.linalg.norm(c, axis=1) + r).max()) for c, r in ((box.centres, box.radii), (centres[own], radii[own])))
    far += float(np.linalg.norm(arm_of(robot).T_links[: box.carrier, :3, 3], axis=1).sum())
    return float(np.ceil(far / REACH_STEP_M)) * REACH_STEP_M


def _circles(robot: Robot, stage: int, centres: NDArray, radii: NDArray, slack: NDArray) -> Circles:
    """The circles of balls, those near one another together, of the big balls around them, and of one around all."""
    low, high = centres.min(axis=0), centres.max(axis=0)
    around, around_radii, groups = gather(centres, radii, low, high, GROUP_M)
    far = np.argsort(-np.linalg.norm(around, axis=1), kind="stable")  # what is far out meets something most often
    around, around_radii, groups = around[far], around_radii[far], np.argsort(far)[groups]
    order = np.argsort(groups, kind="stable")
    first = np.searchsorted(groups[order], np.arange(len(around) + 1))
    middle_of_all = (low + high) / 2
    top = float((np.linalg.norm(centres - middle_of_all, axis=1) + radii).max())
    places = np.concatenate([centres[order], around, middle_of_all[None]])
    most = np.maximum.reduceat(slack[order], first[:-1])
    axis = np.array(arm_of(robot).axes[robot.arm_index[stage]])
    middle = (places @ axis)[:, None] * axis
    across = places - middle
    distance = np.linalg.norm(across, axis=1)
    all_radii, all_slack = np.concatenate([radii[order], around_radii, [top]]), np.concatenate([slack[order], most, [most.max()]])
    return Circles(middle, across, np.cross(axis, across), distance, all_radii, all_slack, first)


def _slack(robot: Robot, centres: NDArray, links: NDArray, held: Between, step: float) -> NDArray:
    """How far (k,) [m] the held joints may move balls on their links out of where they are taken to be.

    A ball is no farther from a joint's axis than along the chain, and what the arm joints move it meanwhile adds to that.
    """
    lengths = np.linalg.norm(arm_of(robot).T_links[:, :3, 3], axis=1)
    joints = robot.other_index[robot.other_index < robot.carrier]
    slack, own = np.zeros(len(centres)), np.linalg.norm(centres, axis=1)
    for joint, low, high in zip(joints, held.lower, held.upper, strict=True):
        chain = np.array([lengths[joint + 1 : link].sum() for link in links])
        far = (own + chain + slack) * (1.0 + 3 * step)
        slack += np.where(links > joint, (high - low) / 2 * far, 0.0)
    return slack
