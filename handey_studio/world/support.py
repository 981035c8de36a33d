"""What a standing part touches, and what holds it up."""

from dataclasses import dataclass

import fcl
import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import apply
from handey_studio.world.collision import column_depth, fcl_convex, least_side, penetration
from handey_studio.world.collision_bodies import DEPTH_MAP, OUTSIDE, columns_of, solids_of
from handey_studio.world.gjk import distance
from handey_studio.world.part import PlacedPart
from handey_studio.world.world import World

TOUCHING_M = 0.0025  # bodies that are believed this near may touch in truth: a pose's error and the depth map's noise
MAX_GAP_M = 0.010  # a destination may hang this far above its support; the guarded descent finds it


@dataclass(frozen=True)
class Neighbour:
    """A body near a standing part. `gap` [m] to it, negative where they overlap; `below` whether it reaches under the part."""

    name: str
    gap: float
    below: bool


def neighbours(world: World, placed: PlacedPart, within: float = TOUCHING_M) -> tuple[Neighbour, ...]:
    """Every body of the world, other than the part itself, that is nearer to it than `within` [m], nearest first."""
    found: dict[str, Neighbour] = {}
    lowest = float(placed.corners_world[:, 2].min())
    for part_piece in placed.part.pieces:
        piece = np.ascontiguousarray(apply(placed.T_world_part, part_piece))
        mine = fcl.CollisionObject(fcl_convex(piece))
        for name, corners in _near(world.without(placed.name), piece, within):
            gap = _gap(name, piece, mine, corners)
            if gap <= within:
                before = found.get(name, Neighbour(name, np.inf, False))
                below = before.below or bool(corners[:, 2].min() < lowest + 2 * within)
                found[name] = Neighbour(name, min(gap, before.gap), below)
    return tuple(sorted(found.values(), key=lambda neighbour: neighbour.gap))


def _near(world: World, piece: NDArray, within: float) -> list[tuple[str, NDArray]]:
    """Names and corners of the solids and columns whose bounding boxes come near a piece's."""
    low, high = piece.min(axis=0) - within, piece.max(axis=0) + within
    solids = [(name, corners) for name, corners in solids_of(world) if name != OUTSIDE]
    columns = columns_of(world.terrain, world.table_z, float(world.free_space[1, 2]))
    near = [(name, corners) for name, corners in solids if not _apart(corners[None], low, high)[0]]
    return near + [(DEPTH_MAP, corners) for corners in columns[~_apart(columns, low, high)]]


def _apart(stack: NDArray, low: NDArray, high: NDArray) -> NDArray:
    """Which bodies (k,) of corners (k, n, 3) have no bounding box in common with low…high."""
    return (stack.max(axis=1) < low).any(axis=1) | (stack.min(axis=1) > high).any(axis=1)


def _gap(name: str, piece: NDArray, mine: fcl.CollisionObject, corners: NDArray) -> float:
    apart = distance(piece, 0, len(piece), np.ascontiguousarray(corners), 0, len(corners), 1e-9)
    if apart > 0:
        return float(apart)
    if name == DEPTH_MAP:
        return -column_depth(piece, mine, corners)
    return -penetration(mine, fcl.CollisionObject(fcl_convex(corners)), least_side(piece, corners))
