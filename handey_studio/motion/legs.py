"""The legs from the start, and from the goal, to the free space: the arm as it is, the wrist as it is (Handey 1987 §4).

Where none of them goes straight, deep in a bin or behind a rim, it goes by way of postures that random trees find: more legs than three.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Progress, Value
from handey_studio.motion.certificate import Mover
from handey_studio.motion.layers import Layers
from handey_studio.motion.query import Query
from handey_studio.motion.random_trees import grow_trees
from handey_studio.motion.regions import nearest_cells

TRIES = 40
WAITING = 5  # of the nearest cells are looked at for one in which the arm can wait for the trees


@dataclass(frozen=True, eq=False)
class EndLeg(Value):
    """A proved way from an end to the centre of a free cell (4,): points (k, joints) [rad], and the mover of each segment."""

    points: NDArray
    movers: tuple[Mover, ...]
    cell: NDArray


@dataclass(frozen=True, eq=False)
class End:
    """One end of a path: its name, its posture (joints,) [rad], the mover that speaks for it, and its layer."""

    name: str
    q: NDArray
    mover: Mover
    layer: int


def leg_to_free(end: End, layers: Layers, region: int) -> EndLeg | None:
    """A straight way from an end to a free cell of a region in its layer.

    The nearest cells are tried first; None when none of them is reached.
    """
    space = layers.spaces[end.layer]
    for cell in nearest_cells(layers.regions, end.layer, space.place(end.q), region, TRIES):
        place = space.at(cell, end.q)
        if end.mover.moves(end.q, place):
            return EndLeg(np.array([end.q, place]), (end.mover,), np.array([end.layer, *cell]))
    return None


def legs_to_free(query: Query, end: End, layers: Layers, region: int, rng: np.random.Generator, progress: Progress) -> EndLeg | None:
    """A way of several legs from an end to the nearest free cell of a region in which the arm can wait; None when the trees find none."""
    space = layers.spaces[end.layer]
    cells = nearest_cells(layers.regions, end.layer, space.place(end.q), region, WAITING)
    cell = next((cell for cell in cells if query.free.stands(space.at(cell, end.q))), None)
    if cell is None:
        return None
    between = replace(query, start=end.q, leaving=end.mover, goal=space.at(cell, end.q), arriving=query.free)
    points, movers, _ = grow_trees(between, query.options.leg_growths, rng, progress)
    return EndLeg(points, tuple(movers), np.array([end.layer, *cell])) if len(points) else None
