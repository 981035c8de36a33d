"""A hand that shows a cube to a range finder whose frame is hidden: made, hidden, to be recovered."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse, rotation_about, transform
from handey_studio.sensing.range_calibration import Shown, TablePoint

FACE_HAND = np.array([0.004, 0.025, 0.012])
HAND = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # level, its fingers side by side


def hand_at(xyz, yaw: float, tilt: NDArray | None = None) -> NDArray:
    R = rotation_about((0, 0, 1), yaw) @ HAND
    return transform(R if tilt is None else R @ tilt, xyz)


def shown_from(T_world_range: NDArray, hands: list[NDArray], noise: float = 0.0, rng: np.random.Generator | None = None) -> list[Shown]:
    rng = rng or np.random.default_rng(0)
    return [Shown(hand, apply(inverse(T_world_range), apply(hand, FACE_HAND)) + rng.normal(0.0, noise, 3)) for hand in hands]


def three_hands(dx: float = 0.1, yaw: float = 0.3) -> list[NDArray]:
    return [hand_at((0.42, 0.01, 0.2), yaw), hand_at((0.42 + dx, 0.01, 0.2), yaw), hand_at((0.42 + dx, 0.01, 0.2), yaw + np.pi)]


def many_hands(n: int, rng: np.random.Generator, spread: float = 0.1, turned: bool = True) -> list[NDArray]:
    places = np.array([0.48, 0.0, 0.2]) + rng.uniform(-spread, spread, (n, 3)) * (1.0, 1.0, 0.4)
    return [hand_at(place, 0.3 + (k % 2) * np.pi * turned) for k, place in enumerate(places)]


def table_of(T_world_range: NDArray, height: float = 0.0) -> TablePoint:
    return TablePoint(apply(inverse(T_world_range), (0.48, 0.0, height)), height)


def frame(x: float = 0.3, y: float = -0.2, z: float = 0.01, yaw: float = 0.4, roll: float = 0.0) -> NDArray:
    return from_xyz_rpy((x, y, z), (roll, 0.0, yaw))
