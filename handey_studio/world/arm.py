"""The living arm: forward kinematics, IK and collision bodies of a robot, built once in each process from its URDF."""

from functools import cached_property, lru_cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, frozen_array
from handey_studio.geometry.transforms import inverse
from handey_studio.world.ik import IK_SOLVERS, branches
from handey_studio.world.link_body import link_body
from handey_studio.world.robot import Robot
from handey_studio.world.screws import Screws


@lru_cache(maxsize=1)
def _pinocchio() -> Any:
    """Pinocchio, which is compiled and has no type information; imported when an arm is first built, as it takes half a second."""
    return import_module("pinocchio")


class Arm:
    """Kinematics and bodies of a robot. Not a value: it holds Pinocchio objects. Use `arm_of(robot)`, which keeps it warm."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        pin = _pinocchio()
        try:
            full = pin.buildModelFromUrdf(robot.urdf)
            collision = pin.buildGeomFromUrdf(full, robot.urdf, pin.GeometryType.COLLISION, package_dirs=[robot.packages])
        except (ValueError, RuntimeError) as error:
            raise BadInput(f'robot "{robot.name}": the URDF "{robot.urdf}" does not load: {error}') from None
        missing = [name for name in robot.joint_names if not full.existJointName(name)]
        if missing:
            raise BadInput(f'robot "{robot.name}" names joints {missing} that its URDF lacks; it has {list(full.names)[1:]}.')
        locked = [full.getJointId(name) for name in list(full.names)[1:] if name not in robot.joint_names]
        self.model, collision = pin.buildReducedModel(full, collision, locked, pin.neutral(full))
        if tuple(list(self.model.names)[1:]) != robot.joint_names:
            raise BadInput(f'robot "{robot.name}": joints must follow the chain {list(self.model.names)[1:]}.')
        if not self.model.existFrame(robot.flange):
            raise BadInput(f'robot "{robot.name}": the URDF has no frame "{robot.flange}"; name its flange frame.')
        self.T_links = frozen_array([M.homogeneous for M in list(self.model.jointPlacements)[1:]])
        """Placement (n, 4, 4) of each joint in the link before it, at zero."""
        self.axes = frozen_array([_joint_axis(self.model, i) for i in range(1, self.model.njoints)])
        """Axis (n, 3) of each joint in its own frame."""
        self.T_last_flange = frozen_array(self.model.frames[self.model.getFrameId(robot.flange)].placement.homogeneous)
        self.T_last_hand = frozen_array(self.T_last_flange @ robot.hand.T_flange_hand)
        self.body_names = tuple(str(g.name) for g in collision.geometryObjects)
        """Names of all collision bodies of the URDF, ignored ones too."""
        self.bodies = tuple(link_body(g) for g in collision.geometryObjects if g.name not in robot.ignored_bodies)

    @cached_property
    def screws(self) -> Screws:
        """The joints' axes in the base's frame, at zero."""
        poses = inverse(self.robot.T_world_base) @ self.link_poses(np.zeros(self.n))
        directions = np.einsum("nij,nj->ni", poses[1:, :3, :3], self.axes)
        return Screws(np.ascontiguousarray(poses[1:, :3, 3]), np.ascontiguousarray(directions), poses[-1] @ self.T_last_flange)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.axes)

    def link_poses(self, q: NDArray) -> NDArray:
        """Ts_world_link (..., n + 1, 4, 4) of the base and each moving link for configurations (..., n) [rad]."""
        q = np.asarray(q, dtype=float)
        T = np.broadcast_to(self.robot.T_world_base, (*q.shape[:-1], 4, 4))
        poses = [T]
        for i in range(self.n):
            T = T @ self.T_links[i] @ _rotations(self.axes[i], q[..., i])
            poses.append(T)
        return np.stack(poses, axis=-3)

    def hand_pose(self, q: NDArray) -> NDArray:
        """T_world_hand (..., 4, 4) for configurations (..., n) [rad]."""
        return self.link_poses(q)[..., -1, :, :] @ self.T_last_hand

    def ik(self, T_world_hand: NDArray, held: NDArray | None = None) -> NDArray:
        """All configurations (k, n) [rad] that put the hand at a pose (4, 4), one a branch, each angle in (-π, π].

        Held joints stand at `held` (h,) [rad], or at each of the robot's values in turn. Those outside the joint limits are included, so
        that the caller can say how far; k = 0 when out of reach. Angles a whole turn away that lie within the limits as well are the same
        branch: see `nearest_turns`.
        """
        T_base_flange = inverse(self.robot.T_world_base) @ T_world_hand @ inverse(self.robot.hand.T_flange_hand)
        values = self.robot.held_values if held is None else np.asarray(held, dtype=float)[None]
        return branches(self._solver, T_base_flange, values, self.robot.held_index)

    def nearest_turns(self, q: NDArray, near: NDArray) -> NDArray:
        """Each angle of q (..., n) shifted by whole turns as close to `near` (n,) as the joint limits allow."""
        turns = np.round((near - q) / (2 * np.pi))
        best = q + 2 * np.pi * turns
        best = np.where(best > self.robot.upper, best - 2 * np.pi, best)
        return np.where(best < self.robot.lower, best + 2 * np.pi, best)

    @cached_property
    def _solver(self):
        try:
            return IK_SOLVERS[self.robot.ik](self)
        except KeyError:
            raise BadInput(f'robot "{self.robot.name}": ik = "{self.robot.ik}" is not known; choose one of {sorted(IK_SOLVERS)}.') from None


@lru_cache(maxsize=8)
def arm_of(robot: Robot) -> Arm:
    """The arm of a robot, built on first use and kept warm in this process."""
    return Arm(robot)


def _rotations(axis: NDArray, angles: NDArray) -> NDArray:
    """Rodrigues' formula: transforms (..., 4, 4) about one axis."""
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    s, c = np.sin(angles)[..., None, None], np.cos(angles)[..., None, None]
    T = np.zeros((*np.shape(angles), 4, 4))
    T[..., :3, :3] = np.eye(3) + s * K + (1 - c) * (K @ K)
    T[..., 3, 3] = 1.0
    return T


def _joint_axis(model: Any, joint: int) -> NDArray:
    """Axis of a revolute joint in its own frame, read off its motion subspace."""
    pin, data = _pinocchio(), model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    column = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL)[:, model.joints[joint].idx_v]
    if np.abs(column[:3]).max() > 1e-9 or model.joints[joint].nv != 1:
        raise BadInput(f'joint "{model.names[joint]}" does not turn about one axis; arms with sliding joints are not supported.')
    return np.round(column[3:], 12)


def hand_hulls(robot: Robot, opening: float) -> dict[str, NDArray]:
    """Name → corners (8, 3) [m] of the hand's boxes in the hand frame."""
    pick = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=bool)
    return {name: np.where(pick, upper, lower) for name, (lower, upper) in robot.hand.boxes(opening).items()}
