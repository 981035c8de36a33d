"""What the hand can do with a part (Handey 1987 §5): its classes and groups, the grasp–placement table, what a MOVE made of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Entry, frozen_array
from handey_studio.cell.workcell import Workcell
from handey_studio.grasping import (
    GOAL,
    START,
    GraspClass,
    GraspEnd,
    GraspGroup,
    GraspPlacementTable,
    GraspPlane,
    fill_grasp_plane,
    grasp_classes,
    grasp_groups,
    grasp_placement_table,
    legal_at,
    rank_terms,
)
from handey_studio.task.options import OPENED_LESS
from handey_studio.task.plan import Carry, GraspChoice, MovePlan, MoveResult
from handey_studio.task.sense import Scene, believed_world
from handey_studio.world import Part, PlacedPart, Robot, World

SAME_POSE = 1e-6


@dataclass(frozen=True, eq=False)
class Handling:
    """What a robot's hand can do with `part`, which stands at `T_world_part` (4, 4), or at the origin as it is modelled.

    `fell` are the entries of the classes and first edges that give no approach group. `costs` (g,) [rad] rank the groups, less is better.
    `start` and `goal` (c,) tell which columns of the table are legal at the ends of a MOVE, None without one; `putdowns` are the grasp
    planes at the putdown of each of its carries.
    """

    part: Part
    T_world_part: NDArray
    classes: tuple[GraspClass, ...]
    groups: tuple[GraspGroup, ...]
    fell: tuple[Entry, ...]
    costs: NDArray
    table: GraspPlacementTable
    start: NDArray | None = None
    goal: NDArray | None = None
    putdowns: tuple[GraspPlane, ...] = ()

    @property
    def rows(self) -> tuple[int, ...]:
        """The table's rows, the start before them and the goal behind them where there is a MOVE."""
        own = tuple(range(len(self.table.Ts_plane_part)))
        return own if self.start is None else (START, *own, GOAL)

    def legal(self, row: int) -> NDArray:
        """Which columns (c,) are legal in a row, `START` and `GOAL` too."""
        if row in (START, GOAL):
            at_end = self.start if row == START else self.goal
            return np.zeros(len(self.table.angles), dtype=bool) if at_end is None else at_end
        return self.table.legal[row]

    def ranked(self) -> list[int]:
        """Numbers of the classes that have groups, the best first, by their best group."""
        best = {k: min((self.costs[g] for g in self.groups_of(k)), default=np.inf) for k in range(len(self.classes))}
        return sorted((k for k in best if np.isfinite(best[k])), key=lambda k: best[k])

    def groups_of(self, number: int) -> list[int]:
        """Numbers of the groups of a class, the best first."""
        wanted = self.classes[number].kind, self.classes[number].features
        own = [g for g, group in enumerate(self.groups) if (group.grasp_class.kind, group.grasp_class.features) == wanted]
        return sorted(own, key=lambda g: self.costs[g])


def handling(part: Part, name: str, robot: Robot, workcell: Workcell, scene: Scene | None, result: MoveResult | None) -> Handling:
    """What can be done with a part; `name` tells which instance, `result` is the MOVE that is looked at, if it moved this part."""
    classes, _ = grasp_classes(part, robot.hand)
    groups, fell = grasp_groups(part, robot.hand)
    table = grasp_placement_table(part, robot.hand)
    world = believed_world(workcell, robot, scene) if scene is not None else World(robot)
    ends = _ends(world, part, result)
    T_world_part = ends[0][0].T_world_part if ends else _standing(world, part, name)
    alone = GraspEnd(World(robot), T_world_part)
    first, last = (ends[0][0], ends[-1][1]) if ends else (alone, alone)
    costs = frozen_array([rank_terms(group, first, last).cost for group in groups])
    told = Handling(part, T_world_part, classes, groups, fell, costs, table)
    if not ends:
        return told
    carries = result.plan.carries if result is not None and result.plan is not None else ()
    putdowns = tuple(_putdown(carry, end, robot) for carry, (_, end) in zip(carries, ends, strict=False))
    start, goal = (frozen_array(legal_at(table, end), bool) for end in (first, last))
    return Handling(part, T_world_part, classes, groups, fell, costs, table, start, goal, putdowns)


def fates(entries: Sequence[Entry]) -> dict[str, Entry]:
    """What became of each grasp group that a search looked at, by its name: one that stood somewhere, else why it fell first."""
    found: dict[str, Entry] = {}
    for entry in entries:
        name = entry.option.removesuffix(OPENED_LESS).split(", symmetry ")[0]
        if entry.stage == "grasp group" and (name not in found or (entry.reason is None and found[name].reason is not None)):
            found[name] = entry
    return found


def way_through(table: GraspPlacementTable, plan: MovePlan) -> tuple[tuple[int, int], ...]:
    """Cells (row, column) of the table that a plan goes through from `START` to `GOAL`, two a carry; none if the table lacks a grasp."""
    cells: list[tuple[int, int]] = []
    for k, carry in enumerate(plan.carries):
        column = column_of(table, carry.grasp)
        if column is None:
            return ()
        cells.append((START if k == 0 else row_of(table, carry.T_world_part_start), column))
        cells.append((GOAL if k == len(plan.carries) - 1 else row_of(table, carry.T_world_part_goal), column))
    return tuple(cells)


def row_of(table: GraspPlacementTable, T_world_part: NDArray) -> int:
    """The row whose placement has the same direction of the part up, or nearly."""
    return int(np.argmax(table.Ts_plane_part[:, 2, :3] @ T_world_part[2, :3])) if len(table.Ts_plane_part) else START


def column_of(table: GraspPlacementTable, grasp: GraspChoice) -> int | None:
    """The column of a grasp's group whose angle is nearest; None if the table has no such group."""
    own = [c for c, g in enumerate(table.group_of) if table.groups[g].name == grasp.group]
    return min(own, key=lambda c: abs(float(table.angles[c]) - grasp.angle)) if own else None


def _ends(world: World, part: Part, result: MoveResult | None) -> list[tuple[GraspEnd, GraspEnd]]:
    """Pickup and putdown of each carry of a MOVE, or of the MOVE as it was wanted; none if it moved another part."""
    if result is None or result.command.part.split("#")[0] != part.name:
        return []
    carries = [(carry.T_world_part_start, carry.T_world_part_goal) for carry in result.plan.carries] if result.plan else []
    if not carries and result.T_world_part_start is not None and result.T_world_part_goal is not None:
        carries = [(result.T_world_part_start, result.T_world_part_goal)]
    moved = next((placed.name for placed in world.parts if carries and _stands(placed, carries[0][0])), None)
    if moved is None:
        return []
    rest = world.without(moved)

    def end(T_world_part: NDArray) -> GraspEnd:
        return GraspEnd(rest.with_part(PlacedPart(moved, part, T_world_part)), T_world_part)

    return [(end(first), end(last)) for first, last in carries]


def _stands(placed: PlacedPart, T_world_part: NDArray) -> bool:
    return bool(np.abs(placed.T_world_part @ placed.part.symmetries - T_world_part).max(axis=(1, 2)).min() < SAME_POSE)


def _standing(world: World, part: Part, name: str) -> NDArray:
    """Where the instance stands, or the first of its kind; the origin if none was found."""
    known = {placed.name: placed.T_world_part for placed in world.parts if placed.part.name == part.name}
    return known.get(name, next(iter(known.values()), np.eye(4)))


def _putdown(carry: Carry, end: GraspEnd, robot: Robot) -> GraspPlane:
    """The grasp plane at a carry's putdown, filled around the same point as the pickup's."""
    grasp = carry.grasp
    middle = carry.approach.plane.origin + carry.approach.plane.cell * len(carry.approach.plane.fingers) / 2.0
    return fill_grasp_plane(end.world, end.T_world_part @ grasp.T_part_plane, middle, robot.hand, grasp.opening)
