"""What a standing part touches, and what holds it up."""

from dataclasses import dataclass

import fcl
import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import apply
from handey_studio.world.collision import fcl_box, fcl_convex, penetration
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
    pieces = [apply(placed.T_world_part, piece) for piece in placed.part.pieces]
    solids = [(name, corners) for name, corners in solids_of(world.without(placed.name)) if name != OUTSIDE]
    solids += [(DEPTH_MAP, corners) for corners in columns_of(world.terrain, world.table_z, float(world.free_space[1, 2]))]
    low = np.min([piece.min(axis=0) for piece in pieces], axis=0) - within
    high = np.max([piece.max(axis=0) for piece in pieces], axis=0) + within
    found: dict[str, Neighbour] = {}
    for name, corners in solids:
        if (corners.max(axis=0) < low).any() or (corners.min(axis=0) > high).any():
            continue
        gap = min(_gap(name, piece, corners) for piece in pieces)
        if gap <= within and (name not in found or gap < found[name].gap):
            below = bool(corners[:, 2].min() < low[2] + 2 * within)
            found[name] = Neighbour(name, gap, below or found.get(name, Neighbour(name, 0, False)).below)
    return tuple(sorted(found.values(), key=lambda neighbour: neighbour.gap))


def _gap(name: str, piece: NDArray, corners: NDArray) -> float:
    apart = distance(np.ascontiguousarray(piece), 0, len(piece), np.ascontiguousarray(corners), 0, len(corners), 1e-9)
    if apart > 0:
        return float(apart)
    other = fcl_box(corners) if name == DEPTH_MAP else fcl.CollisionObject(fcl_convex(corners))
    return -penetration(fcl.CollisionObject(fcl_convex(piece)), other)
