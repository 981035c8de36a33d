"""What a failure in the ledger looks like: where the arm or the hand stood, and which readings it met."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.base import Entry, Posture
from handey_studio.geometry.transforms import apply
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.world import Robot, arm_of, hand_hulls
from handey_studio.world.collision_bodies import DEPTH_MAP

NEAR_M = 0.002  # readings whose columns come this near to a body that met the depth map are shown


def pose_of(numbers: tuple[float, ...]) -> NDArray | None:
    """The pose (4, 4) of sixteen numbers, None if there are none."""
    return np.array(numbers).reshape(4, 4) if len(numbers) == 16 else None


def hand_of(robot: Robot, posture: Posture) -> NDArray | None:
    """T_world_hand (4, 4) of a posture of the arm or of the hand alone; None if it tells neither."""
    arm = arm_of(robot)
    return arm.hand_pose(np.array(posture.q_rad)) if len(posture.q_rad) == arm.n else pose_of(posture.T_world_hand)


@lru_cache(maxsize=8)
def readings_met(scan: DepthMap, robot: Robot, entry: Entry) -> NDArray:
    """Readings (n, 3) [m] of the depth map whose columns reach into the bodies that met it; none where the entry tells of no such thing."""
    posture, nothing = entry.posture, np.empty((0, 3))
    hand = hand_of(robot, posture) if posture is not None else None
    if posture is None or hand is None or DEPTH_MAP not in entry.bodies:
        return nothing
    arm = arm_of(robot)
    hulls = [apply(hand, corners) for name, corners in hand_hulls(robot, posture.opening_m).items() if name in entry.bodies]
    if len(posture.q_rad) == arm.n:
        poses = arm.link_poses(np.array(posture.q_rad))
        hulls += [apply(poses[body.link], hull) for body in arm.bodies if body.name in entry.bodies for hull in body.hulls]
    readings = scan.points_world()
    met = np.zeros(len(readings), dtype=bool)
    for corners in hulls:
        near = ((readings[:, :2] >= corners[:, :2].min(axis=0) - NEAR_M) & (readings[:, :2] <= corners[:, :2].max(axis=0) + NEAR_M)).all(
            axis=1
        )
        met[near] |= columns_meet(readings[near], corners)
    return readings[met]


def columns_meet(tops: NDArray, corners: NDArray) -> NDArray:
    """Whether the space below each of points (n, 3) comes within `NEAR_M` of the hull of corners (k, 3)."""
    planes = ConvexHull(corners).equations
    side = tops[:, :2] @ planes[:, :2].T + planes[:, 3] - NEAR_M
    steep = planes[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        height = -side / steep
    low = np.where(steep < -1e-9, height, -np.inf).max(axis=1)
    high = np.minimum(np.where(steep > 1e-9, height, np.inf).min(axis=1), tops[:, 2])
    beside = np.where(np.abs(steep) <= 1e-9, side, -np.inf).max(axis=1) > 0
    return (low <= high) & ~beside
