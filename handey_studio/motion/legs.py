"""The legs from the start, and from the goal, to the free space: the arm as it is, the wrist as it is (Handey 1987 §4)."""

import heapq
from collections.abc import Callable
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handey_studio.motion.certificate import Mover
from handey_studio.motion.configuration_space import ConfigurationSpace
from handey_studio.motion.search import nearest_free

Node = tuple[int, int, int]

STRAIGHT_TRIES = 40
FINE_STEP_RAD = float(np.deg2rad(2.5))
WINDOW_CELLS = 12  # how far around the end the finer grid looks for free cells, in cells of the space


def leg_to_free(
    mover: Mover, space: ConfigurationSpace, q: NDArray, region: int, expansions: int
) -> tuple[NDArray, tuple[int, int, int]] | None:
    """A proved way (k, joints) from q to the centre of a free cell of a region, and that cell; None when none was found.

    Straight lines to the nearest cells first, then a finer grid around q, of which at most `expansions` nodes are looked at.
    """
    for cell in nearest_free(space, q, region, STRAIGHT_TRIES):
        end = space.at(cell, q)
        if mover.moves(q, end):
            return np.array([q, end]), (int(cell[0]), int(cell[1]), int(cell[2]))
    return _fine_leg(mover, space, q, region, expansions) if expansions else None


def _fine_leg(
    mover: Mover, space: ConfigurationSpace, q: NDArray, region: int, expansions: int
) -> tuple[NDArray, tuple[int, int, int]] | None:
    """Best first over a grid through q, each node and each step proved, guided by the distance to the region's cells."""
    ahead = _distance_to_region(space, q, region)
    if ahead is None:
        return None
    robot = mover.model.world.robot
    parents: dict[Node, Node | None] = {(0, 0, 0): None}
    costs: dict[Node, float] = {(0, 0, 0): 0.0}
    heap: list[tuple[float, Node]] = [(0.0, (0, 0, 0))]
    done: set[Node] = set()
    while heap and len(done) < expansions:
        _, node = heapq.heappop(heap)
        if node in done:
            continue
        done.add(node)
        here = _angles(q, space.joints, node)
        cell = space.cell(here)
        if space.regions[cell] == region:
            end = space.at(np.array(cell), q)
            if mover.moves(here, end):
                return np.array([*(_angles(q, space.joints, n) for n in _chain(parents, node)), end]), cell
        for move in _MOVES:
            beside = (node[0] + move[0], node[1] + move[1], node[2] + move[2])
            there = _angles(q, space.joints, beside)
            cost = costs[node] + float(np.linalg.norm(move)) * FINE_STEP_RAD
            if beside in done or cost >= costs.get(beside, np.inf) or (robot.limit_margin(there) < 0).any() or not mover.moves(here, there):
                continue
            costs[beside], parents[beside] = cost, node
            heapq.heappush(heap, (cost + 2.0 * ahead(there), beside))
    return None


_MOVES = [(a, b, c) for a, b, c in product((-1, 0, 1), repeat=3) if 1 <= abs(a) + abs(b) + abs(c) <= 2]


def _angles(q: NDArray, joints: NDArray, node: Node) -> NDArray:
    out = q.copy()
    out[joints] += np.array(node, dtype=float) * FINE_STEP_RAD
    return out


def _chain(parents: dict[Node, Node | None], node: Node) -> list[Node]:
    chain, parent = [node], parents[node]
    while parent is not None:
        chain.append(parent)
        parent = parents[parent]
    return chain[::-1]


def _distance_to_region(space: ConfigurationSpace, q: NDArray, region: int) -> Callable[[NDArray], float] | None:
    """The joint distance [rad] to the region's cells as a function of q; None when none is near."""
    centre = np.array(space.cell(q))
    low = np.maximum(centre - WINDOW_CELLS, 0)
    high = np.minimum(centre + WINDOW_CELLS + 1, space.blocked.shape)
    window = space.regions[low[0] : high[0], low[1] : high[1], low[2] : high[2]] != region
    if window.all():
        return None
    distances = np.asarray(ndimage.distance_transform_edt(window)) * space.step

    def ahead(here: NDArray) -> float:
        i, j, k = np.clip(np.array(space.cell(here)) - low, 0, np.array(window.shape) - 1)
        return float(distances[i, j, k])

    return ahead
