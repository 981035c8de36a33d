"""Planning problems as MoveIt writes them: a scene of boxes, cylinders and spheres, and a request from a start to a goal.

Only what says where things are is read, in the frame of the robot's base; other keys, and joints that the robot lacks, are passed over.
"""

import reprlib
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.geometry.round_bodies import cuboid, cylinder, sphere
from handey_studio.geometry.transforms import apply, transform
from handey_studio.world.robot import Robot
from handey_studio.world.world import EVERYWHERE, NO_TABLE, ConvexBody, World

MOST_BYTES = 4_000_000
MOST_BODIES = 5_000
DEEPEST = 40  # lists in lists: MoveIt's own files have a dozen
FARTHEST_M = 100.0
SHAPES: dict[str, tuple[int, Callable[..., NDArray]]] = {
    "box": (3, lambda *size: cuboid(np.array(size))),
    "cylinder": (2, cylinder),
    "sphere": (1, sphere),
}
ROS_NUMBERS = {1: "box", 2: "sphere", 3: "cylinder"}  # shape_msgs/SolidPrimitive


@dataclass(frozen=True, eq=False)
class Request(Value):
    """A motion that is asked for: `start` and `goal` (joints,) [rad] in the order of the robot's joint names."""

    start: NDArray
    goal: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen_array(self.start))
        object.__setattr__(self, "goal", frozen_array(self.goal))


def read_scene(path: Path, robot: Robot) -> World:
    """The world of a MoveIt planning scene: its bodies, no table, and all other space free. Raises BadInput with one sentence.

    A cylinder or sphere is a polytope around it that is at most 0.5 mm, or 1 % of the radius, larger.
    """
    world = _entry(_read(path), "world", dict, path)
    objects = _entry(world, "collision_objects", list, path)
    bodies = [body for k, given in enumerate(objects) for body in _bodies(given, k, robot.T_world_base, path)]
    if len(bodies) > MOST_BODIES:
        raise BadInput(f'"{path}" has {len(bodies)} bodies; {MOST_BODIES} are the most that are read.')
    return World(robot, NO_TABLE, tuple(bodies), free_space=EVERYWHERE)


def read_request(path: Path, robot: Robot) -> Request:
    """The start and the first goal of a MoveIt motion request. Raises BadInput with one sentence."""
    content = _read(path)
    state = _entry(_entry(content, "start_state", dict, path), "joint_state", dict, path)
    names, positions = _entry(state, "name", list, path), _entry(state, "position", list, path)
    if len(names) != len(positions):
        raise BadInput(f'"{path}": the start names {len(names)} joints and gives {len(positions)} positions; they must be as many.')
    start = _angles(list(zip(names, positions, strict=True)), "start", robot, path)
    goals = _entry(content, "goal_constraints", list, path)
    if not goals:
        raise BadInput(f'"{path}" has no goal: goal_constraints is empty.')
    rows = _entry(goals[0], "joint_constraints", list, path)
    pairs = [(_entry(row, "joint_name", str, path), row.get("position")) for row in rows if isinstance(row, dict)]
    return Request(start, _angles(pairs, "goal", robot, path))


def _read(path: Path) -> dict[str, Any]:
    """The mapping in a YAML file. Its size, its depth and its references are bounded before anything is built from it."""
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        if path.stat().st_size > MOST_BYTES:
            raise BadInput(f'"{path}" has {path.stat().st_size} bytes; {MOST_BYTES} are the most that are read.')
        text = path.read_text(encoding="utf-8")
        _check_depth(text, loader, path)
        content = yaml.load(text, loader)
    except OSError as error:
        raise BadInput(f'"{path}" cannot be read: {error.strerror}.') from None
    except (UnicodeDecodeError, ValueError, yaml.YAMLError) as error:
        if isinstance(error, BadInput):
            raise
        raise BadInput(f'"{path}" is not a YAML file: {" ".join(str(error).split())[:200]}.') from None
    if not isinstance(content, dict):
        raise BadInput(f'"{path}" must hold a mapping, with "world" for a scene or "start_state" and "goal_constraints" for a request.')
    return content


def _check_depth(text: str, loader: Any, path: Path) -> None:
    depth = 0
    for event in yaml.parse(text, loader):
        if isinstance(event, yaml.AliasEvent):
            raise BadInput(f'"{path}" refers back to "*{event.anchor}"; write the value out, references are not read.')
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise BadInput(f'"{path}" has more than {DEEPEST} lists inside one another.')


def _entry(table: Any, key: str, kind: type, path: Path) -> Any:
    if not isinstance(table, dict) or key not in table:
        raise BadInput(f'"{path}" lacks the key "{key}".')
    if not isinstance(table[key], kind):
        wanted = {dict: "a mapping", list: "a list", str: "a text"}[kind]
        raise BadInput(f'"{path}": "{key}" must be {wanted}, not {reprlib.repr(table[key])}.')
    return table[key]


def _number(value: Any) -> float | None:
    """A finite number, also one that YAML takes for text, such as 1e-3; else None."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return None
    return number if isfinite(number) else None


def _numbers(values: Any, count: int, what: str, path: Path) -> list[float]:
    numbers = [_number(value) for value in values] if isinstance(values, list) else []
    found = [number for number in numbers if number is not None]
    if len(numbers) != count or len(found) != count:
        raise BadInput(f'"{path}": the {what} must be {count} finite {"number" if count == 1 else "numbers"}, not {reprlib.repr(values)}.')
    return found


def _bodies(given: Any, k: int, T_world_base: NDArray, path: Path) -> list[ConvexBody]:
    """The bodies of one collision object, all by its name."""
    if not isinstance(given, dict):
        raise BadInput(f'"{path}": collision object {k + 1} must be a mapping, not {reprlib.repr(given)}.')
    name = str(given.get("id", f"body {k + 1}"))[:80]
    for key in ("meshes", "planes"):
        if given.get(key):
            raise BadInput(f'"{path}": "{name}" has {key}; the shapes that are read are {", ".join(SHAPES)}.')
    shapes, poses = given.get("primitives") or [], given.get("primitive_poses") or []
    if not isinstance(shapes, list) or not isinstance(poses, list) or len(shapes) != len(poses):
        raise BadInput(f'"{path}": "{name}" must have as many primitive_poses as primitives.')
    T_world_object = T_world_base @ _pose(given["pose"], name, path) if given.get("pose") else T_world_base
    corners = [
        apply(T_world_object @ _pose(pose, name, path), _corners(shape, name, path)) for shape, pose in zip(shapes, poses, strict=True)
    ]
    return [ConvexBody(name, each) for each in corners]


def _corners(shape: Any, name: str, path: Path) -> NDArray:
    kind = shape.get("type") if isinstance(shape, dict) else shape
    kind = ROS_NUMBERS.get(kind, kind) if isinstance(kind, int) else kind
    if not isinstance(kind, str) or kind.lower() not in SHAPES:
        raise BadInput(f'"{path}": "{name}" is of the type {reprlib.repr(kind)}; the shapes that are read are {", ".join(SHAPES)}.')
    count, corners = SHAPES[kind.lower()]
    sizes = _numbers(shape.get("dimensions"), count, f'dimensions of the {kind} "{name}"', path)
    if not 0 < min(sizes) <= max(sizes) <= FARTHEST_M:
        raise BadInput(f'"{path}": the dimensions {sizes} of "{name}" must be above 0 and at most {FARTHEST_M:g} m.')
    return corners(*sizes)


def _pose(given: Any, name: str, path: Path) -> NDArray:
    """T (4, 4) from position and xyzw orientation, as lists or as mappings."""
    position, orientation = (given.get("position"), given.get("orientation")) if isinstance(given, dict) else (None, None)
    place = _numbers(_listed(position, "xyz"), 3, f'position of "{name}"', path)
    turn = np.array(_numbers(_listed(orientation, "xyzw"), 4, f'orientation of "{name}"', path))
    if max(map(abs, place)) > FARTHEST_M:
        raise BadInput(f'"{path}": the position {place} of "{name}" lies beyond {FARTHEST_M:g} m.')
    if not 0.99 < np.linalg.norm(turn) < 1.01:
        raise BadInput(f'"{path}": the orientation {turn.tolist()} of "{name}" is no unit quaternion (x, y, z, w).')
    return transform(Rotation.from_quat(turn).as_matrix(), place)


def _listed(values: Any, keys: str) -> Any:
    return [values.get(key) for key in keys] if isinstance(values, dict) else values


def _angles(pairs: list[tuple[Any, Any]], end: str, robot: Robot, path: Path) -> NDArray:
    """Angles (joints,) [rad] of the robot's joints."""
    given = {name: value for name, value in pairs if isinstance(name, str)}
    missing = [name for name in robot.joint_names if name not in given]
    if missing:
        raise BadInput(f'"{path}": the {end} lacks the joint "{missing[0]}"; the robot "{robot.name}" has {", ".join(robot.joint_names)}.')
    return np.array([_numbers([given[name]], 1, f'{end} of joint "{name}"', path)[0] for name in robot.joint_names])
