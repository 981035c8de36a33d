"""The convex bodies of robot and scene as flat arrays, ready for the compiled queries."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry import HeightField
from handey_studio.geometry.transforms import apply
from handey_studio.world.arm import arm_of, hand_hulls
from handey_studio.world.bounding_tree import NOWHERE, Tree, build_tree
from handey_studio.world.part import Held
from handey_studio.world.robot import Robot
from handey_studio.world.world import World

COLUMN_M = 0.001  # columns finer than this are made coarser, the highest wins: coarse ones would reach into what stands beside them
TABLE_SKIN_M = 0.0015  # readings up to this far above the table are the table's own, seen through the sensor's noise
SOLID_M = 2.0  # thickness of the table and of the space outside: more than any arm reaches through
EDGE_M = 50.0  # the table's and the outside's edges: beyond what any arm reaches
DEPTH_MAP, TABLE, OUTSIDE = "depth map", "table", "outside"


class Shapes(NamedTuple):
    """Convex bodies that move with the arm. Body b has `corners[first[b]:first[b + 1]]` [m] in the frame of its link.

    `slide` (b, 3) is how far a body moves in that frame for each metre that the hand opens. `boxes` (b, 8, 3) enclose them.
    `name` numbers their names; `pairs` (p, 2) are the bodies that could meet each other.
    """

    corners: NDArray
    first: NDArray
    link: NDArray
    slide: NDArray
    name: NDArray
    boxes: NDArray
    pairs: NDArray


class Obstacles(NamedTuple):
    """Fixed convex bodies: `corners[first[k]:first[k + 1]]` [m] in the world, the number of their name, and a tree over them."""

    corners: NDArray
    first: NDArray
    name: NDArray
    tree: Tree


class Piece(NamedTuple):
    """One convex body before it is packed: corners (k, 3) [m] in its link's frame."""

    name: str
    link: int
    corners: NDArray
    slide: NDArray


def robot_pieces(robot: Robot) -> list[Piece]:
    """The links' hulls and the hand's boxes with the fingers closed."""
    arm = arm_of(robot)
    links = [Piece(body.name, body.link, hull, np.zeros(3)) for body in arm.bodies for hull in body.hulls]
    closed, apart = hand_hulls(robot, 0.0), hand_hulls(robot, 1.0)
    turn = arm.T_last_hand[:3, :3]
    hand = [
        Piece(name, arm.n, apply(arm.T_last_hand, corners), turn @ (apart[name] - corners).mean(axis=0)) for name, corners in closed.items()
    ]
    return links + hand


def held_pieces(robot: Robot, held: Held) -> list[Piece]:
    """The convex pieces of what the hand holds."""
    T_last_part = arm_of(robot).T_last_hand @ held.T_hand_part
    return [Piece(held.name, arm_of(robot).n, apply(T_last_part, corners), np.zeros(3)) for corners in held.part.pieces]


def pack(pieces: list[Piece], numbers: dict[str, int], touching: frozenset[frozenset[str]]) -> Shapes:
    """Arrays of the bodies. Those on the same link, on neighbouring links, and the pairs in `touching` are never held against each other.

    What the hand carries is the exception: it is held against the link before the hand's.
    """
    last = max(piece.link for piece in pieces)
    arm = {piece.name for piece in pieces if piece.link < last} | {next(p.name for p in pieces if p.link == last)}
    pairs = [
        (a, b)
        for a, one in enumerate(pieces)
        for b, other in enumerate(pieces[a + 1 :], a + 1)
        if other.link - one.link > (1 if other.name in arm else 0) and frozenset((one.name, other.name)) not in touching
    ]
    lower = np.array([piece.corners.min(axis=0) for piece in pieces])
    upper = np.array([piece.corners.max(axis=0) for piece in pieces])
    pick = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=bool)
    return Shapes(
        corners=np.concatenate([piece.corners for piece in pieces]),
        first=np.cumsum([0] + [len(piece.corners) for piece in pieces]),
        link=np.array([piece.link for piece in pieces]),
        slide=np.array([piece.slide for piece in pieces]),
        name=np.array([numbers[piece.name] for piece in pieces]),
        boxes=np.where(pick[None], upper[:, None], lower[:, None]),
        pairs=np.array(pairs, dtype=np.int64).reshape(-1, 2),
    )


def slabs_of(world: World) -> list[tuple[str, NDArray]]:
    """Name and corners (8, 3) [m] in the world of the space outside and the table, as far as there are any."""
    slabs = [(OUTSIDE, corners) for corners in _outside(world.free_space)]
    if np.isfinite(world.table_z):
        lower, upper = np.clip(world.free_space[0] - SOLID_M, -EDGE_M, EDGE_M), np.clip(world.free_space[1] + SOLID_M, -EDGE_M, EDGE_M)
        slabs.append((TABLE, _corners((*lower[:2], world.table_z - SOLID_M), (*upper[:2], world.table_z))))
    return slabs


def solids_of(world: World) -> list[tuple[str, NDArray]]:
    """Name and corners (k, 3) [m] in the world of the slabs first, then the blocks and the parts' convex pieces."""
    solids = slabs_of(world) + [(block.name, block.corners_world) for block in world.blocks]
    return solids + [(placed.name, apply(placed.T_world_part, piece)) for placed in world.parts for piece in placed.part.pieces]


def obstacles_of(solids: list[tuple[str, NDArray]], numbers: dict[str, int]) -> Obstacles:
    """Arrays of fixed bodies."""
    if not solids:
        return Obstacles(np.empty((0, 3)), np.zeros(1, np.int64), np.empty(0, np.int64), NOWHERE)
    low = np.array([corners.min(axis=0) for _, corners in solids])
    high = np.array([corners.max(axis=0) for _, corners in solids])
    return Obstacles(
        corners=np.concatenate([corners for _, corners in solids]),
        first=np.cumsum([0] + [len(corners) for _, corners in solids]),
        name=np.array([numbers[name] for name, _ in solids]),
        tree=build_tree(low, high),
    )


def columns_of(terrain: HeightField | None, table_z: float, ceiling: float) -> NDArray:
    """Corners (k, 8, 3) [m] in the world of the depth map's columns that stand out of the table; no reading is solid to the ceiling."""
    if terrain is None:
        return np.empty((0, 8, 3))
    field = terrain.coarsened(max(1, round(COLUMN_M / terrain.cell)))
    top = np.minimum(np.where(np.isnan(field.top), np.inf, field.top), ceiling - field.T_world_range[2, 3])
    j, i = np.nonzero(top + field.T_world_range[2, 3] > table_z + TABLE_SKIN_M)
    bottom = table_z - SOLID_M - field.T_world_range[2, 3]
    x, y, z = field.T_world_range[:3, :3].T
    lowest = field.T_world_range[:3, 3] + bottom * z + field.cell * (i[:, None] * x + j[:, None] * y)
    sides = np.array([(a * x + b * y) * field.cell for a in (0, 1) for b in (0, 1)])
    corners = np.empty((len(i), 4, 2, 3))
    corners[:, :, 0] = lowest[:, None] + sides
    corners[:, :, 1] = corners[:, :, 0] + ((top[j, i] - bottom)[:, None] * z)[:, None]
    return corners.reshape(-1, 8, 3)


@lru_cache(maxsize=8)
def terrain_obstacles(terrain: HeightField | None, table_z: float, ceiling: float) -> Obstacles:
    """The depth map's columns, kept from world to world; the number of their name is 0."""
    columns = columns_of(terrain, table_z, ceiling)
    k = len(columns)
    low = high = columns
    for half in (4, 2, 1):  # much quicker than the least of eight
        low, high = np.minimum(low[:, :half], low[:, half:]), np.maximum(high[:, :half], high[:, half:])
    tree = build_tree(low[:, 0], high[:, 0]) if k else NOWHERE
    return Obstacles(columns.reshape(-1, 3), np.arange(k + 1) * 8, np.zeros(k, np.int64), tree)


def _corners(lower: tuple[float, ...] | NDArray, upper: tuple[float, ...] | NDArray) -> NDArray:
    pick = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=bool)
    return np.where(pick, upper, lower).astype(float)


def _outside(free: NDArray) -> list[NDArray]:
    """The slabs around the free space, up to six: none where it has no end."""
    slabs = []
    for axis in range(3):
        for side in (0, 1):
            if not np.isfinite(free[side, axis]):
                continue
            lower, upper = np.clip(free[0] - SOLID_M, -EDGE_M, EDGE_M), np.clip(free[1] + SOLID_M, -EDGE_M, EDGE_M)
            if side:
                lower[axis] = free[1, axis]
            else:
                upper[axis] = free[0, axis]
            slabs.append(_corners(lower, upper))
    return slabs
