"""Calibrating the range finder's frame to the robot's (Handey 1987 §6): the hand shows a cube at several poses.

With the hand at T_world_hand, and the middle of the cube's upper face at f in the hand's frame and at v in the range frame,

    T_world_range v = T_world_hand f.

T_world_range is wanted; f is unknown as well, for the cube sits anywhere in the hand. Any other system with a frame of its own that sees
the cube, such as the one that models parts, is calibrated by the same functions: v is then what that system says.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.geometry.transforms import is_rigid, rotation_about, rotation_angle, transform

SAME_PLACE_M, SAME_TURN_RAD = 1e-3, np.deg2rad(0.2)  # how exactly an arm comes to the paper's three poses
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Shown(Value):
    """The cube shown once: T_world_hand (4, 4) by the arm's joints, and the middle of its upper face `face_range` (3,) [m]."""

    T_world_hand: NDArray
    face_range: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_hand", frozen_array(self.T_world_hand))
        object.__setattr__(self, "face_range", frozen_array(self.face_range))
        if not is_rigid(self.T_world_hand) or self.face_range.shape != (3,) or not np.isfinite(self.face_range).all():
            raise BadInput("a pose that shows the cube needs a rigid T_world_hand (4, 4) and three finite coordinates of its face.")


@dataclass(frozen=True, eq=False)
class TablePoint(Value):
    """A point of the table (3,) [m] in the range frame, and the table's height [m] in the world: what tells the frame's own height."""

    point_range: NDArray
    height_world: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "point_range", frozen_array(self.point_range))


def three_pose_frame(shown: Sequence[Shown], table: TablePoint) -> NDArray:
    """T_world_range (4, 4) from the paper's three poses, with z axes that are parallel.

    Pose 2 is pose 1 moved along the world's +x, pose 3 is pose 2 turned by π about the vertical through the wrist; the wrist is the
    origin of the hand's frame here, as any point that stays in its place serves. Two slips of §6 are put right: the vector from v1 to v2
    lies along the robot's x axis, so that the turn from robot to range frame is atan2(Δy, Δx) of it, not atan2(Δx, Δy); and the offset is
    r2 + f − R⁻¹ v2, the face seen from the robot less the face seen from the range frame, where the paper adds the two.
    Raises BadInput when the poses are not these.
    """
    check_three(shown)
    v1, v2, v3 = (one.face_range for one in shown)
    R_range_world = rotation_about(UP, np.arctan2(v2[1] - v1[1], v2[0] - v1[0]))
    face = 0.5 * (R_range_world.T @ (v2 - v3))
    offset = shown[1].T_world_hand[:3, 3] + face - R_range_world.T @ v2
    offset[2] = table.height_world - table.point_range[2]
    return transform(R_range_world.T, offset)


def check_three(shown: Sequence[Shown]) -> None:
    """Raises BadInput with one sentence when shown poses are not the three that the paper asks for."""
    if len(shown) != 3:
        raise BadInput(f"the paper's answer takes 3 poses, these are {len(shown)}.")
    one, two, three = (pose.T_world_hand for pose in shown)
    moved, turned = two[:3, 3] - one[:3, 3], three[:3, :3] @ two[:3, :3].T
    if moved[0] < SAME_PLACE_M or np.abs(moved[1:]).max() > SAME_PLACE_M:
        raise BadInput(f"pose 2 must lie along +x of pose 1, it is off by {np.round(1e3 * moved, 1).tolist()} mm.")
    if rotation_angle(two[:3, :3] @ one[:3, :3].T) > SAME_TURN_RAD:
        raise BadInput("pose 2 must have the orientation of pose 1.")
    off = rotation_angle(turned @ rotation_about(UP, np.pi))
    if np.abs(three[:3, 3] - two[:3, 3]).max() > SAME_PLACE_M or off > SAME_TURN_RAD:
        raise BadInput("pose 3 must be pose 2 turned by 180° about the vertical, its wrist in the same place.")


def rigid_between(points_a: NDArray, points_b: NDArray) -> NDArray:
    """T_a_b (4, 4) that maps points (n, 3) of frame b onto the same points of frame a, by least squares (Kabsch, by singular values)."""
    middle_a, middle_b = points_a.mean(axis=0), points_b.mean(axis=0)
    U, _, Vt = np.linalg.svd((points_a - middle_a).T @ (points_b - middle_b))
    R = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    return transform(R, middle_a - R @ middle_b)


def upright_between(shown: Sequence[Shown]) -> NDArray:
    """T_world_range (4, 4) by least squares in x and y, with parallel z axes, in closed form; its height is taken from the faces.

    In the complex plane p + e^{iφ} f = t + u v, where φ are the turns of the hand since the first pose and |u| = 1. For a given u this is
    linear in f and t; what these cannot explain leaves u as the turn of one complex vector into another.
    """
    hands = np.array([one.T_world_hand for one in shown])
    faces = np.array([one.face_range for one in shown])
    p, v = (xyz[:, 0] + 1j * xyz[:, 1] for xyz in (hands[:, :3, 3], faces))
    turns = hands[:, :3, :3] @ hands[0, :3, :3].T
    columns = np.stack(
        [np.exp(1j * np.arctan2(turns[:, 1, 0] - turns[:, 0, 1], turns[:, 0, 0] + turns[:, 1, 1])), -np.ones(len(p))], axis=1
    )
    U, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    U = U[:, sizes > 1e-2 * sizes[0]]
    v_left, p_left = (x - U @ (U.conj().T @ x) for x in (v, p))
    u = np.vdot(v_left, p_left)
    yaw = float(np.angle(u)) if abs(u) > 1e-12 else 0.0
    t = np.linalg.lstsq(columns, np.exp(1j * yaw) * v - p, rcond=1e-2)[0][1]
    return transform(rotation_about(UP, yaw), (t.real, t.imag, float((hands[:, 2, 3] - faces[:, 2]).mean())))
