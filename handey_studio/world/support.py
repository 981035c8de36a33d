"""What a standing part touches, and what holds it up."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry import HeightField
from handey_studio.geometry.transforms import apply
from handey_studio.world.collision_bodies import DEPTH_MAP, OUTSIDE, solids_of, terrain_obstacles
from handey_studio.world.gjk import distance
from handey_studio.world.overlap import column_depths, column_distances, depth, directions_of
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
    for own in placed.part.pieces:
        piece = np.ascontiguousarray(apply(placed.T_world_part, own))
        for name, gap, bottom in [*_solids(world.without(placed.name), piece, within), *_columns(world, placed, own, piece, within)]:
            before = found.get(name, Neighbour(name, np.inf, False))
            found[name] = Neighbour(name, min(gap, before.gap), before.below or bottom < lowest + 2 * within)
    return tuple(sorted(found.values(), key=lambda neighbour: neighbour.gap))


def _solids(world: World, piece: NDArray, within: float) -> list[tuple[str, float, float]]:
    """Name, gap [m] and lowest z [m] of the solids near a piece of corners (n, 3) [m]."""
    low, high = piece.min(axis=0) - within, piece.max(axis=0) + within
    near = [(name, c) for name, c in solids_of(world) if name != OUTSIDE and not _apart(c[None], low, high)[0]]
    gaps = [(name, _gap(piece, np.ascontiguousarray(corners), within), float(corners[:, 2].min())) for name, corners in near]
    return [found for found in gaps if found[1] <= within]


def _columns(world: World, placed: PlacedPart, own: NDArray, piece: NDArray, within: float) -> list[tuple[str, float, float]]:
    """The same of the depth map: its columns' least gap, and the lowest of them."""
    columns, low, high = _terrain(world.terrain, world.table_z, float(world.free_space[1, 2]))
    near = ((high >= piece.min(axis=0) - within) & (low <= piece.max(axis=0) + within)).all(axis=1)
    columns = columns[near]
    gaps = column_distances(piece, columns, within + 1e-9)
    meeting = gaps <= 0.0
    if meeting.any():
        gaps[meeting] = -column_depths(piece, directions_of(own), placed.T_world_part[:3, :3], columns[meeting])
    columns, gaps = columns[gaps <= within], gaps[gaps <= within]
    return [(DEPTH_MAP, float(gaps.min()), float(columns[:, :, 2].min()))] if len(gaps) else []


@lru_cache(maxsize=8)
def _terrain(terrain: HeightField | None, table_z: float, ceiling: float) -> tuple[NDArray, NDArray, NDArray]:
    """The depth map's columns (k, 8, 3) [m], and their bounding boxes (k, 3) twice."""
    columns = terrain_obstacles(terrain, table_z, ceiling).corners.reshape(-1, 8, 3)
    return columns, columns.min(axis=1), columns.max(axis=1)


def _apart(stack: NDArray, low: NDArray, high: NDArray) -> NDArray:
    """Which bodies (k,) of corners (k, n, 3) have no bounding box in common with low…high."""
    return (stack.max(axis=1) < low).any(axis=1) | (stack.min(axis=1) > high).any(axis=1)


def _gap(piece: NDArray, corners: NDArray, within: float) -> float:
    apart = distance(piece, 0, len(piece), corners, 0, len(corners), within + 1e-9)
    if apart > 0:
        return float(apart)
    return -depth(piece, directions_of(piece), np.eye(3), corners, directions_of(corners), np.eye(3))
