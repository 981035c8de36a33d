"""Ways to the goal on which the part is put down and taken anew (Handey 1987 §5.3): which placements, and where they fit."""

from collections.abc import Iterator
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Ledger
from handey_studio.grasping import (
    GraspEnd,
    GraspPlacementTable,
    PatchOptions,
    RegraspSequence,
    Transfer,
    Wanted,
    free_patches,
    grasp_placement_table,
    legal_at,
    reached_at,
    sequences,
    tilts_at,
    why_none,
)
from handey_studio.task.destination import format_pose
from handey_studio.task.options import Goal, check_goal

PATCHES = 3  # places that are tried for one series of placements
MOST_SEQUENCES = 300  # that are looked through for another series of placements: most differ in their grasps only

Series = tuple[tuple[int, ...], RegraspSequence]
"""Rows of the table, one for each time that the part is put down, and the cheapest sequence through them."""


def detours(goal: Goal, most: int, ledger: Ledger) -> Iterator[tuple[Goal, ...]]:
    """Goals to go to one after the other, with up to `most` regrasps between, the most promising first; the last is `goal`'s own place.

    The sequences come from the part's grasp–placement table; start and goal belong to the scene. What falls is in the ledger, below `goal`.
    """
    part, hand = goal.instance.part, goal.at_start.robot.hand
    entry = ledger.add("regrasp", f"{part.name} by way of another placement", parent=goal.entry)
    table = grasp_placement_table(part, hand)
    start = _costs(table, GraspEnd(goal.at_start, goal.instance.T_world_part))
    end = _costs(table, GraspEnd(goal.at_goal, goal.T_world_goal))
    why = why_none(table, start, end)
    if why:
        ledger.fall(entry, why)
        return
    for rows, sequence in _by_placements(table, start, end, most):
        names = ", ".join(table.placements[table.placement_of[row]].name for row in rows)
        below = ledger.add("placements", names, parent=entry, value=float(sequence.regrasps), unit="")
        yield from _placed(goal, table, sequence, below, ledger)


def _costs(table: GraspPlacementTable, end: GraspEnd) -> NDArray:
    """What each grasp of the table costs at one end (c,): the fingers' tilt [rad], infinity where it is not legal or out of reach."""
    return np.where(reached_at(table, end, legal_at(table, end)), tilts_at(table, end.T_world_part), np.inf)


def _by_placements(table: GraspPlacementTable, start: NDArray, end: NDArray, most: int) -> Iterator[Series]:
    """The cheapest sequence of each series of placements; with one regrasp first, then those with more."""
    seen: set[tuple[int, ...]] = set()

    def known(transfer: Transfer) -> bool:
        return transfer.source < 0 and (int(table.placement_of[transfer.target]),) in seen and transfer.target >= 0

    for regrasps in range(1, most + 1):
        for sequence in islice(sequences(table, start, end, regrasps, regrasps, ruled_out=known), MOST_SEQUENCES):
            rows = tuple(transfer.target for transfer in sequence.transfers[:-1])
            places = tuple(int(table.placement_of[row]) for row in rows)
            if places not in seen:
                seen.add(places)
                yield rows, sequence


def _placed(goal: Goal, table: GraspPlacementTable, sequence: RegraspSequence, entry: int, ledger: Ledger) -> Iterator[tuple[Goal, ...]]:
    """The goals of one sequence, once for each of a few free patches of its first placement."""
    first, *others = sequence.transfers
    if not others:
        yield (goal,)
        return
    placement = table.placements[table.placement_of[first.target]]
    wanted = tuple(_wanted(table, transfer.column) for transfer in (first, others[0]))
    near = goal.instance.T_world_part[:2, 3]
    options = PatchOptions(count=PATCHES, raised=True)
    patches, entries = free_patches(goal.carried, table.part, table.Ts_plane_part[first.target], wanted, near, options)
    ledger.adopt(entries, parent=entry)
    if not patches:
        ledger.fall(entry, "there is no free place for it")
    for patch in patches:
        label = f"{placement.name} at {format_pose(patch.T_world_part)}"
        between = check_goal(goal.at_start, goal.instance, label, patch.T_world_part, ledger, parent=entry)
        if between is None:
            continue
        standing = next(placed for placed in between.at_goal.parts if placed.name == goal.instance.name)
        onward = check_goal(between.at_goal, standing, goal.label, goal.T_world_goal, ledger, parent=between.entry)
        if onward is None:
            continue
        rest = RegraspSequence(tuple(others), sequence.cost)
        for goals in _placed(onward, table, rest, onward.entry, ledger):
            yield (between, *goals)


def _wanted(table: GraspPlacementTable, column: int) -> Wanted:
    return Wanted(table.Ts_part_hand[column], float(table.openings[column]))
