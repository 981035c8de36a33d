"""What a hand can grasp of a shape that is not placed anywhere yet (Handey 1987 §5.1): its classes with their approach groups, ranked."""

from dataclasses import dataclass

import numpy as np

from handey_studio.base import Entry
from handey_studio.geometry import Polyhedron
from handey_studio.grasping import GraspClass, GraspEnd, GraspGroup, grasp_groups, rank_terms
from handey_studio.world import Part, Robot, World

NAME = "model"


@dataclass(frozen=True, eq=False)
class Graspable:
    """`part` as it is modelled; its `classes`, the best first, each with its approach groups, the best first; and the entries that fell."""

    part: Part
    classes: tuple[tuple[GraspClass, tuple[GraspGroup, ...]], ...]
    fell: tuple[Entry, ...]

    @property
    def group_count(self) -> int:
        """How many approach groups there are in all."""
        return sum(len(groups) for _, groups in self.classes)

    @property
    def nearest_miss(self) -> Entry | None:
        """Of what is too wide for the hand, the narrowest; None where nothing is."""
        wide = [entry for entry in self.fell if entry.value is not None and entry.limit is not None and entry.value > entry.limit]
        return min(wide, key=lambda entry: float(entry.value or 0.0), default=None)


def graspable(solid: Polyhedron, robot: Robot) -> Graspable:
    """What the robot's hand can grasp of a solid; no classes where no two features fit between its fingers."""
    part = Part(NAME, solid)
    groups, entries = grasp_groups(part, robot.hand)
    end = GraspEnd(World(robot), np.eye(4))
    ranked = sorted(groups, key=lambda group: rank_terms(group, end, end).cost)
    own: dict[int, tuple[GraspClass, tuple[GraspGroup, ...]]] = {}
    for group in ranked:
        grasp_class, known = own.get(id(group.grasp_class), (group.grasp_class, ()))
        own[id(group.grasp_class)] = grasp_class, (*known, group)
    return Graspable(part, tuple(own.values()), tuple(entry for entry in entries if entry.reason))
