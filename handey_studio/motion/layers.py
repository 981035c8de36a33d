"""Configuration spaces on top of one another, one for each stretch of the wrist's way (after Handey 1987 §4).

In the paper one box holds the wrist at the start, at the goal and in between, and the legs to it are planned apart. With a layer for each
stretch, the wrist as it is at the start, turning, and as it is at the goal, one search finds all: from one layer to the next the arm goes
where both are free. More layers make each box smaller. Where the wrist turns at one place it needs no box: that place is proved by itself.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value
from handey_studio.motion.configuration_space import ConfigurationSpace, configuration_space, extent_around
from handey_studio.motion.query import Query
from handey_studio.motion.regions import Regions, free_regions, region_distances
from handey_studio.motion.wrist_box import WristBox

ROOMY = 2  # so many cells all around are free as well where the wrist turns at one place: most others would fail


@dataclass(frozen=True, eq=False)
class Layers(Value):
    """Spaces of one extent and the wrist boxes that they are for; each box's way begins where that of the layer before ends.

    The cells of the layer `assumed`, if any, are free for the wrist at both ends of its way, but nobody has looked at what is between.
    """

    boxes: tuple[WristBox, ...]
    spaces: tuple[ConfigurationSpace, ...]
    assumed: int | None = None

    @cached_property
    def blocked(self) -> NDArray:
        """Cells (layers, n1, n2, n3)."""
        return np.stack([space.blocked for space in self.spaces])

    @property
    def places(self) -> NDArray:
        """Where (k, 3) [rad] the arm joints are free in all layers: the centres of the cells."""
        return self.spaces[0].centre(np.argwhere(~self.blocked.any(axis=0)))

    @cached_property
    def regions(self) -> Regions:
        """The free regions of all layers together."""
        return free_regions(self.blocked)

    def common_regions(self, start: NDArray, goal: NDArray, most: int) -> list[int]:
        """Regions that are in the first layer and in the last, those that come nearest to start and goal (n,) together first."""
        first = region_distances(self.regions, 0, self.spaces[0].place(start))
        total = first + region_distances(self.regions, len(self.spaces) - 1, self.spaces[-1].place(goal))
        order = np.argsort(total, kind="stable")[:most]
        return [int(k) + 1 for k in order if np.isfinite(total[k])]


def layers_of(query: Query, ways: list[NDArray], step: float) -> Layers:
    """A layer for each stretch (m, joints − 3) [rad] of the wrist's way, with cells `step` [rad] wide."""
    extent = extent_around(query.world.robot, step, np.array([query.start, query.goal]))
    pairs = [configuration_space(query.free, way, extent) for way in ways]
    return Layers(tuple(box for _, box in pairs), tuple(space for space, _ in pairs))


def turned_at_one_place(query: Query, way: NDArray, step: float) -> Layers:
    """Three layers: the wrist as it is at the start of its way (m, joints − 3) [rad], turning, and as it is at the end.

    The turning one is assumed to be free in roomy places: cells that are free for both ends of the way, as all cells around them are.
    """
    ends = layers_of(query, [way[:1], way[-1:]], step)
    crowded: NDArray = np.logical_or(*ends.blocked)
    for axis in range(3):
        crowded = _spread(crowded, axis)
    boxes, spaces = ends.boxes, ends.spaces
    turning = replace(boxes[0], wrists=way), replace(spaces[0], blocked=crowded)
    return Layers((boxes[0], turning[0], boxes[1]), (spaces[0], turning[1], spaces[1]), 1)


def _spread(blocked: NDArray, axis: int) -> NDArray:
    """Cells (n1, n2, n3) that are blocked, and those up to `ROOMY` from them along an axis."""
    out = blocked.copy()
    here, there = np.moveaxis(blocked, axis, 0), np.moveaxis(out, axis, 0)
    for shift in range(1, ROOMY + 1):
        there[shift:] |= here[:-shift]
        there[:-shift] |= here[shift:]
    return out
