"""Locate the objects (Handey 1987 §2, first step): a depth map, the parts found in it, and what stays solid."""

import time
from dataclasses import dataclass, field

import numpy as np

from handey_studio.base import Progress, Silent, Value
from handey_studio.cell.workcell import Workcell
from handey_studio.geometry import HeightField
from handey_studio.localization import LocatedPose, LocateOptions, LocateResult, localize
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.solid import solid_columns, without_parts
from handey_studio.world import Part, PlacedPart, Robot, World


@dataclass(frozen=True, eq=False)
class Scene(Value):
    """What was sensed: the depth map, the localizer's record, and the instances it found (`l_block#1`, …, best first).

    Behind them stand those that it did not find but that were known before and that the readings bear out; `known` names these, and
    those of the others that could be otherwise by this view alone.
    """

    depth_map: DepthMap
    located: LocateResult
    instances: tuple[PlacedPart, ...]
    timing_s: dict[str, float] = field(default_factory=dict)
    known: tuple[str, ...] = ()

    @property
    def doubts(self) -> dict[str, float]:
        """For each instance how probable the likeliest other reading of it is, as a share of its own probability, but for those known."""
        poses = ((placed, pose) for placed, pose in zip(self.instances, self.located.poses, strict=False) if placed.name not in self.known)
        return {placed.name: max((r.probability for r in pose.rivals), default=0.0) / max(pose.score, 1e-9) for placed, pose in poses}

    def instance(self, name: str) -> PlacedPart | None:
        """The instance of that name, None if it was not found."""
        return next((placed for placed in self.instances if placed.name == name), None)


def understand(
    depth_map: DepthMap,
    parts: tuple[Part, ...],
    rng: np.random.Generator,
    options: LocateOptions = LocateOptions(),
    progress: Progress = Silent(),
) -> Scene:
    """Find the parts in a depth map."""
    start = time.perf_counter()
    located = localize(depth_map.view(), parts, options, rng, progress)
    return Scene(depth_map, located, name_instances(located.poses, parts), {"locate": time.perf_counter() - start})


def name_instances(poses: tuple[LocatedPose, ...], parts: tuple[Part, ...]) -> tuple[PlacedPart, ...]:
    """`part#1`, `part#2`, … in the order in which they were found, best first."""
    models = {part.name: part for part in parts}
    counts = dict.fromkeys(models, 0)
    placed = []
    for pose in poses:
        counts[pose.part] += 1
        placed.append(PlacedPart(f"{pose.part}#{counts[pose.part]}", models[pose.part], pose.T_world_part))
    return tuple(placed)


def believed_world(workcell: Workcell, robot: Robot, scene: Scene) -> World:
    """The world as sensed: located parts as exact solids, everything else that the depth map does not vouch for as columns."""
    return World(
        robot,
        workcell.table_z,
        workcell.blocks,
        scene.instances,
        remaining_columns(scene),
        workcell.free_space,
    )


def remaining_columns(scene: Scene) -> HeightField:
    """The depth map's solid columns once the located parts have left it."""
    return without_parts(scene.depth_map, solid_columns(scene.depth_map), scene.instances)
