"""Destinations as people type them: `x,y,z[,roll,pitch,yaw]`, `on:PART[:POSE]` or `in:x0,y0,x1,y1`."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.base.errors import unknown_name
from handey_studio.geometry.transforms import from_xyz_rpy, to_xyz_rpy
from handey_studio.world import Part, PlacedPart

MAX_COORDINATE_M = 10.0  # farther than any arm on a table reaches; millimetres typed for metres are caught by it


@dataclass(frozen=True, eq=False)
class FixedPose(Value):
    """A pose in the world."""

    T_world_part: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_part", frozen_array(self.T_world_part))


@dataclass(frozen=True)
class MatingPose:
    """On another part, by a mating pose named in that part's sidecar. `part` is a part's name or an instance."""

    part: str
    pose: str


@dataclass(frozen=True)
class Area:
    """Anywhere in a rectangle of the world, from `low` (x, y) to `high` [m], standing as it may."""

    low: tuple[float, float]
    high: tuple[float, float]


Destination = FixedPose | MatingPose | Area


def base_name(name: str) -> str:
    """`l_block` of `l_block#2`."""
    return name.split("#")[0]


def parse_destination(text: str, moved: str, parts: dict[str, Part]) -> Destination:
    """What a destination means for the part `moved` (a name or an instance). Raises BadInput with one sentence."""
    if text.startswith("on:"):
        return _parse_mating(text, moved, parts)
    if text.startswith("in:"):
        return _parse_area(text)
    words = text.split(",")
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise BadInput(
            f'destination "{text[:80]}" is not understood; give x,y,z[,roll,pitch,yaw] in metres and degrees, '
            "on:PART[:POSE] or in:x0,y0,x1,y1."
        ) from None
    if len(numbers) not in (3, 6) or not np.isfinite(numbers).all():
        raise BadInput(f'destination "{text[:80]}" has {len(numbers)} numbers; it takes 3 or 6 finite ones: x,y,z[,roll,pitch,yaw].')
    farthest = np.abs(numbers[:3]).max()
    if farthest > MAX_COORDINATE_M:
        raise BadInput(f'destination "{text[:80]}" lies {farthest:g} m away, the limit is {MAX_COORDINATE_M:g} m; are these metres?')
    return FixedPose(from_xyz_rpy(numbers[:3], np.deg2rad(numbers[3:] or (0.0, 0.0, 0.0))))


def _parse_area(text: str) -> Area:
    words = text.removeprefix("in:").split(",")
    try:
        x0, y0, x1, y1 = (float(word) for word in words)
    except ValueError:
        raise BadInput(f'area "{text[:80]}" is not in:x0,y0,x1,y1, four numbers in metres.') from None
    if not np.isfinite([x0, y0, x1, y1]).all() or max(map(abs, (x0, y0, x1, y1))) > MAX_COORDINATE_M or x0 == x1 or y0 == y1:
        raise BadInput(f'area "{text[:80]}" must have two different x and two different y within {MAX_COORDINATE_M:g} m; are these metres?')
    return Area((min(x0, x1), min(y0, y1)), (max(x0, x1), max(y0, y1)))


def _parse_mating(text: str, moved: str, parts: dict[str, Part]) -> MatingPose:
    target, _, pose = text.removeprefix("on:").partition(":")
    if base_name(target) not in parts:
        raise unknown_name("part", target, parts)
    fitting = {name: mate for name, mate in parts[base_name(target)].mates.items() if mate.part == base_name(moved)}
    if pose and pose not in fitting:
        raise unknown_name(f'mating pose of "{moved}" on "{target}"', pose, fitting)
    if not pose and len(fitting) != 1:
        known = ", ".join(sorted(fitting)) or "none"
        raise BadInput(f'"{moved}" has {len(fitting)} mating poses on "{target}": {known}; name one as on:{target}:POSE.')
    return MatingPose(target, pose or next(iter(fitting)))


def goal_poses(
    destination: Destination, moved: str, parts: dict[str, Part], instances: tuple[PlacedPart, ...]
) -> list[tuple[str, NDArray]]:
    """(what it is, T_world_part) for each way to read the destination among the located instances; empty if none is there, and for an
    area, where it depends on the scene what is free (see `areas`)."""
    if isinstance(destination, Area):
        return []
    if isinstance(destination, FixedPose):
        return [(format_pose(destination.T_world_part), destination.T_world_part)]
    mate = parts[base_name(destination.part)].mates[destination.pose]
    goals = []
    for placed in instances:
        if placed.name != moved and destination.part in (placed.name, placed.part.name):
            for k, S in enumerate(placed.part.symmetries):
                turned = f", turned by its symmetry {k}" if k else ""
                goals.append((f"on {placed.name}:{destination.pose}{turned}", placed.T_world_part @ S @ mate.T_this_part))
    return goals


def format_pose(T_world_part: NDArray) -> str:
    """A pose as a destination is typed: metres to a hundredth of a millimetre, degrees to a thousandth."""
    xyz, rpy = to_xyz_rpy(T_world_part)
    numbers = [f"{value:.5f}" for value in xyz] + [f"{value:.3f}" for value in np.rad2deg(rpy)]
    return ",".join(str(float(number) + 0.0) for number in numbers)
