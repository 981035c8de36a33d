"""Reading `robot.toml`: what must stand in it, in one sentence a fault, and the robot that it describes."""

import os
import tomllib
from collections.abc import Iterator
from importlib import metadata
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.world.robot import Hand, Robot

EXAMPLE_ROBOT_DATA = "example-robot-data:"
TEXT, TEXTS, NUMBER, NUMBERS, TABLE = "a text", "a list of texts", "a finite number", "a list of finite numbers", "a table"
LIMITS = ("lower_deg", "upper_deg", "velocity_deg_s", "acceleration_deg_s2")
PER_JOINT = (*LIMITS, "jerk_deg_s3")
RISE_S = 0.1  # without jerk_deg_s3 a joint takes this long from rest to its full acceleration
TOOL_SPEED_M_S, TOOL_ACCELERATION_M_S2 = 0.25, 1.2  # of straight motions: what Universal Robots' controllers take unless told otherwise
LENGTHS = (
    "finger_length_m",
    "finger_width_m",
    "finger_thickness_m",
    "crosspiece_length_m",
    "crosspiece_width_m",
    "crosspiece_height_m",
    "mount_radius_m",
    "opening_min_m",
    "opening_max_m",
)
REQUIRED = {
    "name": TEXT,
    "urdf": TEXT,
    "ik": TEXT,
    "flange": TEXT,
    "arm_joints": TEXTS,
    "wrist_joints": TEXTS,
    "home_deg": NUMBERS,
    "limits": TABLE,
    **{f"limits.{key}": NUMBERS for key in LIMITS},
    "hand": TABLE,
    **{f"hand.{key}": NUMBER for key in (*LENGTHS, "force_N", "min_contact_area_mm2")},
    "hand.mount": TABLE,
    "hand.mount.xyz_m": NUMBERS,
}
OPTIONAL = {
    "limits.jerk_deg_s3": NUMBERS,
    "limits.tool_speed_m_s": NUMBER,
    "limits.tool_acceleration_m_s2": NUMBER,
    "joints": TEXTS,
    "ignored_bodies": TEXTS,
    "held_joints": TABLE,
    "held_joints.*": NUMBERS,
    "base": TABLE,
    "base.xyz_m": NUMBERS,
    "base.rpy_deg": NUMBERS,
    "hand.mount.rpy_deg": NUMBERS,
    "hand.pad_friction": NUMBER,
}


def load_robot(folder: str | os.PathLike) -> Robot:
    """The robot described by `robot.toml` in a folder. Raises BadInput with one sentence."""
    path, table = read_table(folder)
    for fault in table_faults(table):
        raise BadInput(f'"{path}" {fault}')
    robot = robot_of(table, path.parent)
    for fault in robot_faults(robot):
        raise BadInput(f'"{path}": {fault}')
    return robot


def read_table(folder: str | os.PathLike) -> tuple[Path, dict[str, Any]]:
    """The file and its content. Raises BadInput where there is none, or no TOML."""
    path = Path(folder) / "robot.toml"
    try:
        return path, tomllib.loads(path.read_text())
    except FileNotFoundError:
        raise BadInput(f'robot folder "{folder}" has no robot.toml.') from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BadInput(f'"{path}" cannot be read as TOML: {error}.') from None


def table_faults(table: dict[str, Any]) -> Iterator[str]:
    """What is missing or of the wrong kind in a robot.toml, in sentences that follow its name."""
    present = dict(_entries(table))
    for key, kind in REQUIRED.items():
        under = key.rpartition(".")[0]
        if key not in present and (not under or isinstance(present.get(under), dict)):
            yield f"lacks the key '{key}'; it must be {kind}, see robots/ur5/robot.toml for every key."
    wrong = [key for key, value in present.items() if _kind(key) and not _is(value, _kind(key))]
    for key in wrong:
        yield f"has {key} = {str(present[key])[:60]}; it must be {_kind(key)}."
    if not wrong:
        yield from _joint_faults(table, present)


def unknown_keys(table: dict[str, Any]) -> list[str]:
    """Keys that mean nothing here: slips of the pen, or notes."""
    return [key for key, _ in _entries(table) if not _kind(key)]


def _entries(table: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        yield prefix + key, value
        if isinstance(value, dict):
            yield from _entries(value, f"{prefix}{key}.")


def _kind(key: str) -> str:
    known = REQUIRED | OPTIONAL
    return known.get(key) or known.get(f"{key.rpartition('.')[0]}.*", "")


def _is(value: Any, kind: str) -> bool:
    if kind in (TEXTS, NUMBERS):
        return isinstance(value, list) and len(value) > 0 and all(_is(item, TEXT if kind == TEXTS else NUMBER) for item in value)
    if kind == NUMBER:
        return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))
    return isinstance(value, str if kind == TEXT else dict)


def _joint_faults(table: dict[str, Any], present: dict[str, Any]) -> Iterator[str]:
    """Joints that are not told apart, and lists that do not have one number a joint."""
    if not {"arm_joints", "wrist_joints"} <= present.keys():
        return
    arm, wrist, held = table["arm_joints"], table["wrist_joints"], list(table.get("held_joints", {}))
    joints = table.get("joints", arm + wrist)
    if len(arm) != 3:
        yield f"has arm_joints = {arm}; it takes exactly 3: the configuration space's."
        return
    if held and "joints" not in table:
        yield "lacks the key 'joints'; with held_joints it lists all joints in the chain's order."
    elif sorted(joints) != sorted([*arm, *wrist, *held]):
        yield f"has joints = {joints}; it must name each of arm_joints, wrist_joints and held_joints once."
    elif [name for name in joints if name not in held] != arm + wrist:
        yield f"has joints = {joints}; without the held ones they must be arm_joints, then wrist_joints: {arm + wrist}."
    for key in ("home_deg", *(f"limits.{key}" for key in PER_JOINT)):
        if len(present.get(key, joints)) != len(joints):
            yield f"has {len(present[key])} numbers in {key}; it must list {len(joints)} finite numbers, one a joint."
    for key in ("base.xyz_m", "base.rpy_deg", "hand.mount.xyz_m", "hand.mount.rpy_deg"):
        if len(present.get(key, "xyz")) != 3:
            yield f"has {len(present[key])} numbers in {key}; it must list 3."


def robot_of(table: dict[str, Any], folder: Path) -> Robot:
    """The robot of a faultless table. Raises BadInput if its URDF does not exist."""
    urdf, packages = _urdf_path(table["urdf"], folder)
    held = table.get("held_joints", {})
    limits = {key: np.deg2rad(table["limits"][key]) for key in PER_JOINT if key in table["limits"]}
    return Robot(
        name=table["name"],
        urdf=urdf,
        packages=packages,
        ik=table["ik"],
        flange=table["flange"],
        T_world_base=_transform(table.get("base", {"xyz_m": (0, 0, 0)})),
        joint_names=tuple(table.get("joints", table["arm_joints"] + table["wrist_joints"])),
        arm_joints=tuple(table["arm_joints"]),
        wrist_joints=tuple(table["wrist_joints"]),
        held_joints=tuple(held),
        held_values=np.deg2rad(np.array(list(product(*held.values())), dtype=float)),
        lower=limits["lower_deg"],
        upper=limits["upper_deg"],
        velocity=limits["velocity_deg_s"],
        acceleration=limits["acceleration_deg_s2"],
        jerk=limits.get("jerk_deg_s3", limits["acceleration_deg_s2"] / RISE_S),
        tool_speed=float(table["limits"].get("tool_speed_m_s", TOOL_SPEED_M_S)),
        tool_acceleration=float(table["limits"].get("tool_acceleration_m_s2", TOOL_ACCELERATION_M_S2)),
        home=np.deg2rad(table["home_deg"]),
        ignored_bodies=tuple(table.get("ignored_bodies", ())),
        hand=_hand(table["hand"]),
    )


def _hand(table: dict[str, Any]) -> Hand:
    return Hand(
        **{key.removesuffix("_m"): float(table[key]) for key in LENGTHS},
        force=float(table["force_N"]),
        min_contact_area=float(table["min_contact_area_mm2"]) * 1e-6,
        T_flange_hand=_transform(table["mount"]),
        pad_friction=float(table.get("pad_friction", 1.0)),
    )


def _transform(table: dict[str, Any]) -> NDArray:
    return from_xyz_rpy(table.get("xyz_m", (0, 0, 0)), np.deg2rad(table.get("rpy_deg", (0, 0, 0))))


def robot_faults(robot: Robot) -> Iterator[str]:
    """What cannot be of a robot that was read: limits, home, held values, the hand's measures. One sentence each."""
    for k, joint in enumerate(robot.joint_names):
        lower, upper, home = np.rad2deg([robot.lower[k], robot.upper[k], robot.home[k]])
        if not lower < upper:
            yield f"the limits of {joint} are {lower:g}° to {upper:g}°; lower_deg must lie below upper_deg."
        elif not lower <= home <= upper:
            yield f"home_deg lies outside the joint limits: {joint} at {home:g}°, it takes {lower:g}° to {upper:g}°."
        if not (robot.velocity[k] > 0 and robot.acceleration[k] > 0 and robot.jerk[k] > 0):
            yield f"velocity_deg_s, acceleration_deg_s2 and jerk_deg_s3 of {joint} must be above 0."
    if not (robot.tool_speed > 0 and robot.tool_acceleration > 0):
        yield "limits.tool_speed_m_s and limits.tool_acceleration_m_s2 must be above 0."
    for k, column in zip(robot.held_index, robot.held_values.T, strict=True):
        low, high = np.rad2deg([robot.lower[k], robot.upper[k]])
        for value in np.rad2deg(column[(column < robot.lower[k]) | (column > robot.upper[k])]):
            yield f"held_joints has {robot.joint_names[k]} at {value:g}°, outside its limits; it takes {low:g}° to {high:g}°."
    yield from _hand_faults(robot.hand)


def _hand_faults(hand: Hand) -> Iterator[str]:
    for key in LENGTHS[:-2]:
        if not getattr(hand, key.removesuffix("_m")) > 0:
            yield f"hand.{key} is {getattr(hand, key.removesuffix('_m')):g}; it must be above 0."
    if not 0 <= hand.opening_min < hand.opening_max:
        yield f"the hand opens from {hand.opening_min:g} to {hand.opening_max:g} m; it must hold 0 ≤ opening_min_m < opening_max_m."
    if hand.opening_max > hand.crosspiece_length:
        yield (
            f"the hand opens to {hand.opening_max:g} m on a crosspiece of {hand.crosspiece_length:g} m; "
            f"opening_max_m must not be more than crosspiece_length_m."
        )
    if not (hand.force > 0 and hand.min_contact_area > 0 and hand.pad_friction > 0):
        yield "hand.force_N, hand.min_contact_area_mm2 and hand.pad_friction must be above 0."
    face = hand.finger_length * hand.finger_width
    if hand.min_contact_area > face:
        yield (
            f"hand.min_contact_area_mm2 is {1e6 * hand.min_contact_area:g}, more than the finger's whole face; "
            f"it must be at most {1e6 * face:g}."
        )


def _urdf_path(urdf: str, folder: Path) -> tuple[str, str]:
    """Path of the URDF and the folder that its `package://` names start from."""
    if urdf.startswith(EXAMPLE_ROBOT_DATA):
        root = example_robot_data_root()
        path, packages = root / "robots" / urdf.removeprefix(EXAMPLE_ROBOT_DATA), root.parent
    else:
        path, packages = (folder / urdf).resolve(), folder.resolve()
    if not path.is_file():
        raise BadInput(f'the URDF "{path}" does not exist.')
    return str(path), str(packages)


def example_robot_data_root() -> Path:
    """The `share/example-robot-data` folder of the installed package, which is data only and cannot be imported."""
    for file in metadata.files("example-robot-data") or ():
        parts = file.parts
        if "share" in parts and "robots" in parts:
            root = Path(str(file.locate()))
            return root.parents[len(parts) - 1 - parts.index("robots")]
    raise BadInput("the package example-robot-data holds no robots; install it again.")
