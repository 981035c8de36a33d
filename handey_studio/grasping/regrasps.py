"""Sequences of grasps and placements that take a part from one pose to another (Handey 1987 §5.3, after Tournassoud et al. 1987).

In the grasp–placement table a transfer moves along a column, from one placement to another with the same grasp, and a regrasp
along a row, from one grasp to another at the same placement. Start and goal are rows of their own that belong to the scene.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.grasping.grasp_placement_table import GraspPlacementTable

START, GOAL = -1, -2


class Transfer(NamedTuple):
    """The part is carried with the grasp of `column` from one row of the table (or `START`) to another (or `GOAL`)."""

    source: int
    column: int
    target: int


@dataclass(frozen=True)
class RegraspSequence:
    """Transfers from the start to the goal, each ending where the next begins; `regrasps` is how often the part is put down between."""

    transfers: tuple[Transfer, ...]
    cost: float

    @property
    def regrasps(self) -> int:
        return len(self.transfers) - 1


@dataclass(frozen=True)
class SequenceCosts:
    """What the cheapest is measured by: `regrasp` for each, `tilt` for each radian of the fingers off straight down where the part is taken
    or put down, and `tip` over the placement's tipping angle [rad]. One regrasp more costs more than any tilts saved."""

    regrasp: float = 10.0
    tilt: float = 1.0
    tip: float = 0.2


class _Standing(NamedTuple):
    """A sequence not yet complete: the part stands at `row` (or `START`) after `transfers`, the last with grasp `column`, and `left` more
    placements are to come. Of the grasps that may go on, cheapest first, those before `rank` were taken already."""

    transfers: tuple[Transfer, ...]
    paid: float
    row: int
    column: int
    left: int
    rank: int


def sequences(
    table: GraspPlacementTable,
    start: NDArray,
    goal: NDArray,
    fewest: int = 1,
    most: int = 3,
    costs: SequenceCosts = SequenceCosts(),
    ruled_out: Callable[[Transfer], bool] = lambda transfer: False,
) -> Iterator[RegraspSequence]:
    """Every sequence with `fewest` to `most` regrasps, the cheapest first, found as they are asked for.

    `start` and `goal` (c,) tell what each column costs at either end, such as the fingers' tilt [rad] there; infinity where the grasp is
    not legal. `ruled_out` is asked about every transfer before it is used, so whatever the caller learns between two sequences holds for
    all that follow.
    """
    tips = np.array([placement.tip for placement in table.placements])[table.placement_of]
    visits = np.where(table.legal, costs.tilt * table.tilts, np.inf)
    rows = costs.regrasp + costs.tip / np.maximum(tips, 1e-3)
    return cheapest_sequences(visits, rows, costs.tilt * np.asarray(start), costs.tilt * np.asarray(goal), fewest, most, ruled_out)


def cheapest_sequences(
    visits: NDArray, rows: NDArray, start: NDArray, goal: NDArray, fewest: int, most: int, ruled_out: Callable[[Transfer], bool]
) -> Iterator[RegraspSequence]:
    """The search of `sequences` over plain costs: `visits` (r, c) of putting down or taking at a row with a column, infinity where that is
    not legal, `rows` (r,) of a regrasp there, `start` and `goal` (c,).

    Best first by what was paid and the least cost of what is left; of the grasps at a row only the next one waits in the queue.
    """
    onward = [np.vstack([visits + rest, start + rest]) for rest in _remaining(visits, rows, goal, most)]  # `START` is the last row
    order = [np.argsort(costs, axis=1, kind="stable") for costs in onward]
    ties, heap = count(), []

    def wait(standing: _Standing) -> None:
        if standing.rank < order[0].shape[1]:
            column = order[standing.left][standing.row, standing.rank]
            cost = standing.paid + float(onward[standing.left][standing.row, column])
            if np.isfinite(cost):
                heappush(heap, (cost, next(ties), standing))

    for left in range(fewest, most + 1):
        wait(_Standing((), 0.0, START, -1, left, 0))
    while heap:
        cost, _, at = heappop(heap)
        if any(ruled_out(transfer) for transfer in at.transfers):
            continue
        if at.row == GOAL:
            yield RegraspSequence(at.transfers, cost)
            continue
        wait(at._replace(rank=at.rank + 1))
        column = int(order[at.left][at.row, at.rank])
        if column == at.column:
            continue
        if at.left == 0:
            heappush(heap, (cost, next(ties), at._replace(transfers=(*at.transfers, Transfer(at.row, column, GOAL)), row=GOAL)))
            continue
        for standing in _put_down(at, column, float(start[column] if at.row == START else visits[at.row, column]), visits, rows):
            wait(standing)


def _put_down(at: _Standing, column: int, taken: float, visits: NDArray, rows: NDArray) -> Iterator[_Standing]:
    """Where the part can be put down next once it is taken with a grasp at the cost `taken`."""
    for row in np.nonzero(np.isfinite(visits[:, column]))[0]:
        if row == at.row:
            continue
        paid = at.paid + taken + float(visits[row, column] + rows[row])
        yield _Standing((*at.transfers, Transfer(at.row, column, int(row))), paid, int(row), column, at.left - 1, 0)


def _remaining(visits: NDArray, rows: NDArray, goal: NDArray, most: int) -> list[NDArray]:
    """Least cost (c,) from holding the part with each grasp, with 0, 1, … `most` placements still to come, to the goal."""
    remaining = [np.asarray(goal, dtype=float)]
    for _ in range(most):
        through = rows + (visits + remaining[-1]).min(axis=1, initial=np.inf)
        remaining.append((visits + through[:, None]).min(axis=0, initial=np.inf))
    return remaining


def why_none(table: GraspPlacementTable, start: NDArray, goal: NDArray) -> str:
    """Why there is no sequence at all, however long, in a sentence; empty if there might be one."""
    if not table.placements:
        return "the part can stand on none of its faces"
    from_start, to_goal = np.isfinite(start), np.isfinite(goal)
    for where, legal in (("start", from_start), ("goal", to_goal)):
        if not legal.any():
            return f"none of the part's grasps is legal and in reach at the {where}"
        if not (table.legal & legal).any():
            return f"of the {legal.sum()} grasps that are legal at the {where} none is legal at any of {len(table.placements)} placements"
    reached, held = np.zeros(len(table.legal), dtype=bool), from_start
    while not (held & to_goal & table.legal.any(axis=0)).any():
        more = np.asarray((table.legal & held).any(axis=1))
        if (more == reached).all():
            return f"it comes to stand in {reached.sum()} of {len(reached)} ways, and none of them allows a grasp that is legal at the goal"
        reached, held = more, np.asarray((table.legal & more[:, None]).any(axis=0))
    return ""
