"""Rigid transforms as 4×4 float64 arrays.

`T_a_b` maps b coordinates to a coordinates, so that neighbours cancel: `T_a_c = T_a_b @ T_b_c`.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation


def transform(rotation: ArrayLike | None = None, translation: ArrayLike = (0.0, 0.0, 0.0)) -> NDArray:
    """T (4, 4) from a rotation matrix (3, 3), identity when None, and a translation (3,) [m]."""
    T = np.eye(4)
    if rotation is not None:
        T[:3, :3] = rotation
    T[:3, 3] = translation
    return T


def from_xyz_rpy(xyz: ArrayLike, rpy: ArrayLike = (0.0, 0.0, 0.0)) -> NDArray:
    """T (4, 4) from a position [m] and roll, pitch, yaw [rad]: extrinsic rotations about x, then y, then z."""
    return transform(Rotation.from_euler("xyz", np.asarray(rpy, dtype=float)).as_matrix(), xyz)


def to_xyz_rpy(T: ArrayLike) -> tuple[NDArray, NDArray]:
    """Position [m] and roll, pitch, yaw [rad] of a transform; at pitch ±90° the yaw is taken as zero."""
    T = np.asarray(T, dtype=float)
    with np.errstate(all="ignore"):
        rpy = Rotation.from_matrix(T[:3, :3]).as_euler("xyz", suppress_warnings=True)
    return T[:3, 3].copy(), rpy


def inverse(T: NDArray) -> NDArray:
    """Inverse of rigid transforms (..., 4, 4)."""
    R_inverse = np.swapaxes(T[..., :3, :3], -1, -2)
    result = np.zeros_like(T)
    result[..., :3, :3] = R_inverse
    result[..., :3, 3] = -np.einsum("...ij,...j->...i", R_inverse, T[..., :3, 3])
    result[..., 3, 3] = 1.0
    return result


def apply(T: NDArray, points: ArrayLike) -> NDArray:
    """Points (..., 3) mapped by one transform (4, 4)."""
    return np.asarray(points, dtype=float) @ T[:3, :3].T + T[:3, 3]


def rotate(T: NDArray, directions: ArrayLike) -> NDArray:
    """Directions (..., 3) turned by the rotation of one transform (4, 4)."""
    return np.asarray(directions, dtype=float) @ T[:3, :3].T


def rotation_about(axis: ArrayLike, angle: float) -> NDArray:
    """Rotation matrix (3, 3) about a direction (3,) of any length by an angle [rad]."""
    axis = np.asarray(axis, dtype=float)
    return Rotation.from_rotvec(axis / np.linalg.norm(axis) * angle).as_matrix()


def rotation_angle(R: NDArray) -> float:
    """Angle [rad] of a rotation matrix (3, 3), in [0, π]; exact near zero, where the arc cosine of the trace is not."""
    return float(Rotation.from_matrix(R).magnitude())


def pose_difference(T_a: NDArray, T_b: NDArray) -> tuple[float, float]:
    """Distance of the origins [m] and angle [rad] between two poses."""
    return float(np.linalg.norm(T_a[:3, 3] - T_b[:3, 3])), rotation_angle(T_a[:3, :3].T @ T_b[:3, :3])


def is_rigid(T: ArrayLike, tolerance: float = 1e-6) -> bool:
    """Whether T is a finite 4×4 transform with a proper rotation and last row 0, 0, 0, 1."""
    T = np.asarray(T, dtype=float)
    return bool(
        T.shape == (4, 4)
        and np.isfinite(T).all()
        and np.abs(T[3] - (0, 0, 0, 1)).max() <= tolerance
        and np.abs(T[:3, :3]).max() <= 1.0 + tolerance
        and np.abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max() <= tolerance
        and np.linalg.det(T[:3, :3]) > 0
    )


def to_wxyz(T: NDArray) -> NDArray:
    """Unit quaternion (w, x, y, z) of a transform's rotation."""
    return Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True)
