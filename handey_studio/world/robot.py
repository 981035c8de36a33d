"""Robots: plain descriptions, read from `robot.toml` by `robot_file`. The living arm model is built from them in each process."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array


@dataclass(frozen=True, eq=False)
class Hand(Value):
    """Two opposing rectangular fingers that slide on a crosspiece (Handey 1987 §5). Lengths in metres.

    The hand frame sits midway between the fingertips: z from the crosspiece towards the tips, x along the crosspiece, so
    that the fingers close along it, y across the fingers. `T_flange_hand` (4, 4) says where the arm carries it.
    The crosspiece and its mount reach from the fingers' roots back to the flange.
    Each finger presses with `force` [N]; the friction between them is `pad_friction` times the part's own.
    """

    finger_length: float
    finger_width: float
    finger_thickness: float
    crosspiece_length: float
    crosspiece_width: float
    crosspiece_height: float
    mount_radius: float
    opening_min: float
    opening_max: float
    force: float
    min_contact_area: float
    T_flange_hand: NDArray
    pad_friction: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_flange_hand", frozen_array(self.T_flange_hand))

    def boxes(self, opening: float) -> dict[str, tuple[NDArray, NDArray]]:
        """Name → (lower, upper) corners (3,) [m] in the hand frame, with the fingers `opening` [m] apart."""
        half, w, t = opening / 2.0, self.finger_width / 2.0, self.finger_thickness
        top, back = -self.finger_length, -self.finger_length - self.crosspiece_height
        mount = float(self.T_flange_hand[2, 3])
        boxes = {
            "finger_left": (np.array([-half - t, -w, top]), np.array([-half, w, 0.0])),
            "finger_right": (np.array([half, -w, top]), np.array([half + t, w, 0.0])),
            "crosspiece": (
                np.array([-self.crosspiece_length / 2.0, -self.crosspiece_width / 2.0, back]),
                np.array([self.crosspiece_length / 2.0, self.crosspiece_width / 2.0, top]),
            ),
        }
        if mount > -back:
            r = self.mount_radius
            boxes["mount"] = (np.array([-r, -r, -mount]), np.array([r, r, back]))
        return boxes


FINGERS = ("finger_left", "finger_right")


@dataclass(frozen=True, eq=False)
class Robot(Value):
    """An arm with a hand. Angles in radians, one number a joint, in the order of `joint_names`, which is the chain's.

    The three `arm_joints` span the configuration space, the `wrist_joints` follow the last of them. A redundant arm has h `held_joints`
    as well: inverse kinematics tries them at each row of `held_values` (m, h) [rad] in turn. `arm_index`, `wrist_index` and `held_index`
    pick them out of a configuration, `other_index` all but the arm's. Link `carrier`, moved by the last arm joint, carries the wrist.
    `velocity`, `acceleration` and `jerk` [rad/s, rad/s², rad/s³] limit every joint, `tool_speed` and `tool_acceleration` [m/s, m/s²] the
    hand in straight motions.
    """

    name: str
    urdf: str
    packages: str
    ik: str
    flange: str
    T_world_base: NDArray
    joint_names: tuple[str, ...]
    arm_joints: tuple[str, ...]
    wrist_joints: tuple[str, ...]
    held_joints: tuple[str, ...]
    held_values: NDArray
    lower: NDArray
    upper: NDArray
    velocity: NDArray
    acceleration: NDArray
    jerk: NDArray
    tool_speed: float
    tool_acceleration: float
    home: NDArray
    ignored_bodies: tuple[str, ...]
    hand: Hand

    def __post_init__(self) -> None:
        for key in ("T_world_base", "held_values", "lower", "upper", "velocity", "acceleration", "jerk", "home"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))

    @property
    def arm_index(self) -> NDArray:
        return self._index(self.arm_joints)

    @property
    def wrist_index(self) -> NDArray:
        return self._index(self.wrist_joints)

    @property
    def held_index(self) -> NDArray:
        return self._index(self.held_joints)

    @property
    def other_index(self) -> NDArray:
        """Held and wrist joints, in the chain's order."""
        return np.delete(np.arange(len(self.joint_names)), self.arm_index)

    @property
    def carrier(self) -> int:
        """Number of the link that carries the wrist, where 0 is the base and i is what joint i carries."""
        return int(self.arm_index[-1]) + 1

    def holding(self, q: NDArray) -> str:
        """What the held joints do on the way from the first to the last of configurations (m, n) [rad]; empty for an arm without any."""
        words = []
        for name, first, last in zip(self.held_joints, *np.rad2deg(q[[0, -1]][:, self.held_index]), strict=True):
            held = abs(last - first) < 1e-6
            words.append(f"{name} held at {first:.0f}°" if held else f"{name} turned from {first:.0f}° to {last:.0f}°")
        return ", ".join(words)

    def _index(self, names: tuple[str, ...]) -> NDArray:
        return np.array([self.joint_names.index(name) for name in names], dtype=int)

    def limit_margin(self, q: NDArray) -> NDArray:
        """Least distance [rad] to a joint limit, for configurations (..., n); negative outside."""
        return np.minimum(q - self.lower, self.upper - q).min(axis=-1)
