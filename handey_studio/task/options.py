"""The options of a MOVE: which instance, which reading of the destination, which symmetric view of the part, which grasp group.

Handey "simply lists all possible solutions, ranks them heuristically, and tries them sequentially" (§7). Here they are the roots of one
search (`search`), and every one that falls leaves its reason in the ledger.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger, Value, frozen_array
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.grasping import GraspEnd, GraspGroup, grasp_groups, rank_terms, topples_by
from handey_studio.world import PlacedPart, World
from handey_studio.world.collision import ALLOWED_DEPTH_M
from handey_studio.world.support import MAX_GAP_M, TOUCHING_M, Neighbour, neighbours

Pairs = tuple[tuple[str, str], ...]

OPENED_LESS = ", opened less"  # ends the names of such options
OPENED_LESS_COST = 0.3  # [rad of tilt] what it is worth to pass the part at a distance
LAST_BIT_M = 0.006  # that far, at least, a part is lifted straight up and put straight down: what is nearer above it lies on it


@dataclass(frozen=True, eq=False)
class Goal(Value):
    """One instance to move and one place for it: the worlds with the part at the start, in the hand, and at the goal.

    `supports_at_start` and `supports_at_goal` are the pairs that may touch while it is lifted, and while it is put down.
    """

    instance: PlacedPart
    label: str
    T_world_goal: NDArray
    entry: int
    at_start: World
    carried: World
    at_goal: World
    supports_at_start: Pairs
    supports_at_goal: Pairs

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_goal", frozen_array(self.T_world_goal))


@dataclass(frozen=True, eq=False)
class Option(Value):
    """A grasp group at both ends of a goal. `symmetry` counts the part's symmetries: the start pose is relabelled by it."""

    goal: Goal
    symmetry: int
    group: GraspGroup
    cost: float

    @property
    def T_world_start(self) -> NDArray:
        """The part's start pose (4, 4) under this symmetry: it looks the same, and makes another motion to the goal."""
        return self.goal.instance.T_world_part @ self.goal.instance.part.symmetries[self.symmetry]

    @property
    def pickup(self) -> GraspEnd:
        return GraspEnd(self.goal.at_start, self.T_world_start)

    @property
    def putdown(self) -> GraspEnd:
        return GraspEnd(self.goal.at_goal, self.goal.T_world_goal)

    @property
    def opening(self) -> float:
        """How far [m] the hand opens to go around the part."""
        return self.group.opening(self.goal.at_start.robot.hand)

    @property
    def name(self) -> str:
        turned = f", symmetry {self.symmetry}" if self.symmetry else ""
        return f"{self.group.name}{turned}{'' if self.group.opened_less else OPENED_LESS}"

    def opened_less(self) -> "Option | None":
        """The same with the hand opened as little as goes around the part; None if it is."""
        group = self.group.opened_less
        return replace(self, group=group, cost=self.cost + OPENED_LESS_COST) if group else None


def check_goal(
    world: World, instance: PlacedPart, label: str, T_world_goal: NDArray, ledger: Ledger, parent: int | None = None
) -> Goal | None:
    """The goal, if the part can stand there: nothing in its way and something below it. Else None, and why in the ledger."""
    entry = ledger.add("destination", f"{instance.name} to {label}", parent=parent)
    carried = world.without(instance.name)
    placed = PlacedPart(instance.name, instance.part, T_world_goal)
    low, high = world.free_space
    outside = np.maximum(low - placed.corners_world, placed.corners_world - high).max()
    if outside > 0 and placed.corners_world[:, 2].min() > world.table_z - ALLOWED_DEPTH_M:
        ledger.fall(entry, "the destination lies outside the free space", value=outside, limit=0.0, unit="m")
        return None
    near, beside = neighbours(carried, placed, MAX_GAP_M), neighbours(carried, instance)
    if _in_the_way(near, "the part would stand in something at the destination", placed.name, entry, ledger):
        return None
    if not any(neighbour.below for neighbour in near):
        height = placed.corners_world[:, 2].min() - world.table_z
        ledger.fall(entry, "nothing holds the part up at the destination", value=height, limit=MAX_GAP_M, unit="m")
        return None
    beyond = topples_by(carried, placed)
    if beyond > 0.0:
        words = "the part would fall over at the destination: its centre of mass is not above what it stands on"
        ledger.fall(entry, words, value=beyond, limit=0.0, unit="m")
        return None
    lies = "something lies or leans on the part where it is"
    lifts = (
        (beside, lies),
        (neighbours(carried, raised(instance, LAST_BIT_M)), lies),
        (neighbours(carried, raised(placed, LAST_BIT_M)), "there is no room above the part at the destination"),
    )
    if any(_in_the_way(met, what, placed.name, entry, ledger) for met, what in lifts):
        return None
    at_start = tuple((instance.name, neighbour.name) for neighbour in beside)
    at_goal = tuple((instance.name, neighbour.name) for neighbour in near if neighbour.gap <= TOUCHING_M)
    return Goal(instance, label, T_world_goal, entry, world, carried, carried.with_part(placed), at_start, at_goal)


def raised(placed: PlacedPart, height: float) -> PlacedPart:
    """The same instance that much [m] higher."""
    return replace(placed, T_world_part=from_xyz_rpy((0.0, 0.0, height), (0.0, 0.0, 0.0)) @ placed.T_world_part)


def _in_the_way(near: tuple[Neighbour, ...], what: str, name: str, entry: int, ledger: Ledger) -> bool:
    """Whether the part is deeper in one of its neighbours than touching bodies may be; if so the entry falls."""
    for neighbour in near:
        if neighbour.gap < -ALLOWED_DEPTH_M:
            ledger.fall(entry, what, value=-neighbour.gap, limit=ALLOWED_DEPTH_M, unit="m", bodies=(name, neighbour.name))
            return True
    return False


def options_of(goal: Goal, ledger: Ledger) -> list[Option]:
    """Every option of a goal, with what it costs [rad of tilt] by its geometry alone."""
    part, hand = goal.instance.part, goal.at_start.robot.hand
    groups, entries = grasp_groups(part, hand)
    ledger.adopt(entries, parent=goal.entry)
    options = []
    for symmetry in range(len(part.symmetries)):
        ends = GraspEnd(goal.at_start, goal.instance.T_world_part @ part.symmetries[symmetry]), GraspEnd(goal.at_goal, goal.T_world_goal)
        options += [Option(goal, symmetry, group, rank_terms(group, *ends).cost) for group in groups]
    return options
