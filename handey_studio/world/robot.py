"""Robots: plain descriptions read from `robot.toml`. The living arm model is built from them in each process."""

import os
import tomllib
from dataclasses import dataclass, replace
from importlib import metadata
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.geometry.transforms import from_xyz_rpy

EXAMPLE_ROBOT_DATA = "example-robot-data:"


@dataclass(frozen=True, eq=False)
class Hand(Value):
    """Two opposing rectangular fingers that slide on a crosspiece (Handey 1987 §5). Lengths in metres.

    The hand frame sits midway between the fingertips: z from the crosspiece towards the tips, x along the crosspiece, so
    that the fingers close along it, y across the fingers. `T_flange_hand` (4, 4) says where the arm carries it.
    The crosspiece and its mount reach from the fingers' roots back to the flange.
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
    home: NDArray
    ignored_bodies: tuple[str, ...]
    hand: Hand

    def __post_init__(self) -> None:
        for key in ("T_world_base", "held_values", "lower", "upper", "velocity", "acceleration", "home"):
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

    def _index(self, names: tuple[str, ...]) -> NDArray:
        return np.array([self.joint_names.index(name) for name in names], dtype=int)

    def limit_margin(self, q: NDArray) -> NDArray:
        """Least distance [rad] to a joint limit, for configurations (..., n); negative outside."""
        return np.minimum(q - self.lower, self.upper - q).min(axis=-1)


def load_robot(folder: str | os.PathLike) -> Robot:
    """The robot described by `robot.toml` in a folder. Raises BadInput with one sentence."""
    path = Path(folder) / "robot.toml"
    try:
        table = tomllib.loads(path.read_text())
    except FileNotFoundError:
        raise BadInput(f'robot folder "{folder}" has no robot.toml.') from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BadInput(f'"{path}" cannot be read as TOML: {error}.') from None
    try:
        return _robot(table, path.parent)
    except KeyError as error:
        raise BadInput(f'"{path}" lacks the key {error}; see robots/ur5/robot.toml for every key.') from None
    except (TypeError, ValueError) as error:
        raise BadInput(f'"{path}": {error}') from None


def _robot(table: dict[str, Any], folder: Path) -> Robot:
    arm, wrist, held, joints = _joints(table)
    urdf, packages = _urdf_path(table["urdf"], folder)
    base = table.get("base", {})
    limits = table["limits"]
    columns = ("lower_deg", "upper_deg", "velocity_deg_s", "acceleration_deg_s2")
    per_joint = {key: np.deg2rad(_numbers(limits[key], key, len(joints))) for key in columns}
    robot = Robot(
        name=table["name"],
        urdf=urdf,
        packages=packages,
        ik=table["ik"],
        flange=table["flange"],
        T_world_base=from_xyz_rpy(base.get("xyz_m", (0, 0, 0)), np.deg2rad(base.get("rpy_deg", (0, 0, 0)))),
        joint_names=joints,
        arm_joints=arm,
        wrist_joints=wrist,
        held_joints=tuple(held),
        held_values=np.deg2rad(np.array(list(product(*held.values())), dtype=float)),
        lower=per_joint["lower_deg"],
        upper=per_joint["upper_deg"],
        velocity=per_joint["velocity_deg_s"],
        acceleration=per_joint["acceleration_deg_s2"],
        home=np.deg2rad(_numbers(table["home_deg"], "home_deg", len(joints))),
        ignored_bodies=tuple(table.get("ignored_bodies", ())),
        hand=_hand(table["hand"]),
    )
    _check_limits(robot)
    return robot


def _joints(table: dict[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...], dict[str, list[float]], tuple[str, ...]]:
    """Arm joints, wrist joints, held joints with their values [deg], and all of them in the chain's order."""
    arm, wrist = tuple(table["arm_joints"]), tuple(table["wrist_joints"])
    held = {name: _numbers(values, f"held_joints.{name}") for name, values in table.get("held_joints", {}).items()}
    joints = tuple(table["joints"]) if held else tuple(table.get("joints", arm + wrist))
    if len(arm) != 3:
        raise ValueError(f"arm_joints names {len(arm)} joints, it takes exactly 3: the configuration space's.")
    if sorted(joints) != sorted({*arm, *wrist, *held}) or len(joints) != len(arm) + len(wrist) + len(held):
        raise ValueError(f"joints lists {list(joints)}; it must name each of arm_joints, wrist_joints and held_joints once.")
    if tuple(name for name in joints if name in arm + wrist) != arm + wrist:
        raise ValueError(f"the arm joints, then the wrist joints must follow the chain {list(joints)}, as {list(arm + wrist)} do not.")
    return arm, wrist, held, joints


def _check_limits(robot: Robot) -> None:
    if not (robot.lower < robot.upper).all():
        joint = robot.joint_names[int(np.argmin(robot.upper - robot.lower))]
        raise ValueError(f"the limits of {joint} are empty; lower_deg must lie below upper_deg.")
    for key in ("velocity", "acceleration"):
        if not (getattr(robot, key) > 0).all():
            raise ValueError(f"every {key} limit must be above 0.")
    if (robot.limit_margin(robot.home) < 0).any():
        raise ValueError("home_deg lies outside the joint limits; choose a home inside them.")
    held = robot.held_index
    if ((robot.held_values < robot.lower[held]) | (robot.held_values > robot.upper[held])).any():
        raise ValueError("held_joints has values outside the joint limits; choose values inside them.")


def _hand(table: dict[str, Any]) -> Hand:
    lengths = {key[:-2]: float(value) for key, value in table.items() if key.endswith("_m")}
    mount = table["mount"]
    hand = Hand(
        **lengths,
        force=float(table["force_N"]),
        min_contact_area=float(table["min_contact_area_mm2"]) * 1e-6,
        T_flange_hand=from_xyz_rpy(mount["xyz_m"], np.deg2rad(mount.get("rpy_deg", (0, 0, 0)))),
    )
    if not 0 <= hand.opening_min < hand.opening_max <= hand.crosspiece_length:
        raise ValueError(f"the hand opens from {hand.opening_min} to {hand.opening_max} m; it must hold 0 ≤ min < max ≤ crosspiece length.")
    return hand


def _numbers(values: Any, key: str, count: int | None = None) -> list[float]:
    """A list of `count` finite numbers, or of at least one."""
    finite = isinstance(values, list) and all(isinstance(v, (int, float)) and np.isfinite(v) for v in values)
    if not finite or len(values) != (count or max(len(values), 1)):
        raise ValueError(f"{key} must list {f'{count} finite numbers, one a joint' if count else 'at least one finite number'}.")
    return [float(v) for v in values]


def _urdf_path(urdf: str, folder: Path) -> tuple[str, str]:
    """Path of the URDF and the folder that its `package://` names start from."""
    if urdf.startswith(EXAMPLE_ROBOT_DATA):
        root = example_robot_data_root()
        return str(root / "robots" / urdf.removeprefix(EXAMPLE_ROBOT_DATA)), str(root.parent)
    path = (folder / urdf).resolve()
    if not path.is_file():
        raise BadInput(f'the URDF "{path}" does not exist.')
    return str(path), str(folder.resolve())


def example_robot_data_root() -> Path:
    """The `share/example-robot-data` folder of the installed package, which is data only and cannot be imported."""
    for file in metadata.files("example-robot-data") or ():
        parts = file.parts
        if "share" in parts and "robots" in parts:
            root = Path(str(file.locate()))
            return root.parents[len(parts) - 1 - parts.index("robots")]
    raise BadInput("the package example-robot-data holds no robots; install it again.")


def mounted_at(robot: Robot, T_world_base: NDArray) -> Robot:
    """The same robot standing elsewhere."""
    return replace(robot, T_world_base=T_world_base)
