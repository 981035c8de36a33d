"""Balls that are inside the arm's links whatever joints turn that the configuration space does not know of."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import inverse
from handey_studio.motion.distance_field import faces_by_direction
from handey_studio.motion.turning import Between
from handey_studio.motion.wrist_box import balls_around
from handey_studio.world import Robot, arm_of
from handey_studio.world.collision_bodies import robot_pieces

DIE_M = 0.06
LEAST_M = 0.02  # smaller balls prove next to nothing


class InnerBalls(NamedTuple):
    """Balls inside the links: centres (k, 3) [m] in the frame of the link that arm joint `stage` (k,) carries, radii (k,) [m]."""

    centres: NDArray
    radii: NDArray
    stage: NDArray


def inner_balls(robot: Robot) -> InnerBalls:
    """Balls inside the links from the first arm joint's to the carrier, wherever held joints turn these."""
    centres, radii, stages = [], [], []
    poses = arm_of(robot).link_poses(unturned(robot).posture(robot))
    for piece in robot_pieces(robot):
        stage = int(np.searchsorted(robot.arm_index, piece.link)) - 1
        if stage < 0 or piece.link > robot.carrier or (robot.held_index < robot.arm_index[stage]).any():
            continue  # where a held joint turns the hinge itself, nothing is sure
        planes, _ = faces_by_direction(piece.corners)
        for centre in balls_around(piece.corners, DIE_M)[0]:
            depth = -float((planes[:, :3] @ centre + planes[:, 3]).max())
            spot, off = _on_held_axes(robot, poses, piece.link, stage, centre)
            if depth - off > LEAST_M:
                centres.append(spot)
                radii.append(depth - off)
                stages.append(stage)
    return InnerBalls(np.array(centres).reshape(-1, 3), np.array(radii, float), np.array(stages, np.int64))


def _on_held_axes(robot: Robot, poses: NDArray, link: int, stage: int, centre: NDArray) -> tuple[NDArray, float]:
    """A point (3,) [m] of a link, in the frame of the link that arm joint `stage` carries, moved onto the axes of the held joints between
    the two, where these do not move it; and how far [m] it was moved.
    """
    spot, off = poses[link] @ np.append(centre, 1.0), 0.0
    for joint in sorted((int(k) for k in robot.held_index if robot.arm_index[stage] < k < link), reverse=True):
        origin, axis = poses[joint + 1][:3, 3], poses[joint + 1][:3, :3] @ arm_of(robot).axes[joint]
        foot = origin + ((spot[:3] - origin) @ axis) * axis
        off += float(np.linalg.norm(foot - spot[:3]))
        spot = np.append(foot, 1.0)
    return (inverse(poses[robot.arm_index[stage] + 1]) @ spot)[:3], off


def unturned(robot: Robot) -> Between:
    """The held joints before the carrier at zero."""
    zeros = (0.0,) * int((robot.other_index < robot.carrier).sum())
    return Between(zeros, zeros)
