"""The arm model of the configuration space: spheres over the arm's links, and over the box that stands for wrist, hand and part.

Handey 1987 §4 replaces the wrist's links by a box that encloses them, the hand and what it holds, at the start, at the goal
and in between. Here the box is filled with spheres only where something passes, which leaves more of the space free. The
link that carries the wrist is no obstacle to it.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import manifold3d
import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.geometry.transforms import inverse
from handey_studio.world import Held, Robot, arm_of
from handey_studio.world.collision_bodies import Piece, held_pieces, robot_pieces

CHIP_M = 0.025  # what the wrist carries is diced this fine before it is gathered into spheres
SWEEP_M = 0.01  # how far anything may move from one sampled wrist posture to the next
LINK_BALLS_M = 0.04  # the links before the one that carries the wrist pass close above the table
CARRIER_BALLS_M = 0.06
BALL_SIZES_M = (0.04, 0.05, 0.06, 0.08, 0.10, 0.14, 0.20)
MOST_BALLS = 90

Balls = tuple[NDArray, NDArray]  # centres (k, 3), radii (k,) [m]


@dataclass(frozen=True, eq=False)
class ArmSpheres(Value):
    """Spheres that enclose the arm: `centres` (k, 3) [m] in the frame of link `links` (k,), `radii` (k,) [m].

    `box` (8, 3) [m] are the corners of the wrist box in the frame of link `carrier`, the last one that has spheres. They hold while the
    joints other than the arm's stay within `ranges` (2, joints − 3) [rad].
    """

    centres: NDArray
    radii: NDArray
    links: NDArray
    box: NDArray
    carrier: int
    ranges: NDArray

    def __post_init__(self) -> None:
        for key, dtype in (("centres", float), ("radii", float), ("links", int), ("box", float), ("ranges", float)):
            object.__setattr__(self, key, frozen_array(getattr(self, key), dtype))


def arm_spheres(robot: Robot, wrists: NDArray, opening: float, held: Held | None) -> ArmSpheres:
    """The spheres of the arm while its other joints run joint-linearly through `wrists` (m, joints − 3) [rad].

    The fingers are `opening` [m] apart.
    """
    centres, radii, links = [], [], []
    for piece, (c, r) in _robot_balls(robot):
        if 1 <= piece.link <= robot.carrier:
            centres.append(c)
            radii.append(r)
            links.append(np.full(len(r), piece.link))
    carried = [pair for pair in _robot_balls(robot) if pair[0].link > robot.carrier] + (list(_held_balls(robot, held)) if held else [])
    swept, corners = sweep(robot, carried, wrists, opening)
    for size in BALL_SIZES_M:
        c, r = gather(*swept, size)
        if len(r) <= MOST_BALLS:
            break
    pick = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=bool)
    box = np.where(pick, corners.max(axis=0) + SWEEP_M / 2, corners.min(axis=0) - SWEEP_M / 2)
    on = np.concatenate([*links, np.full(len(r), robot.carrier)])
    ranges = np.array([wrists.min(axis=0), wrists.max(axis=0)])
    return ArmSpheres(np.concatenate([*centres, c]), np.concatenate([*radii, r]), on, box, robot.carrier, ranges)


@lru_cache(maxsize=8)
def _robot_balls(robot: Robot) -> tuple[tuple[Piece, Balls], ...]:
    def size(link: int) -> float:
        return CHIP_M if link > robot.carrier else CARRIER_BALLS_M if link == robot.carrier else LINK_BALLS_M

    return tuple((piece, dice(piece.corners, size(piece.link))) for piece in robot_pieces(robot))


@lru_cache(maxsize=32)
def _held_balls(robot: Robot, held: Held) -> tuple[tuple[Piece, Balls], ...]:
    return tuple((piece, dice(piece.corners, CHIP_M)) for piece in held_pieces(robot, held))


def dice(corners: NDArray, size: float) -> Balls:
    """Balls around the dice, at most `size` [m] wide, that a convex body, corners (k, 3) [m], is cut into."""
    dies = [manifold3d.Manifold.hull_points(np.array(corners))]
    for axis in range(3):
        low, high = corners[:, axis].min(), corners[:, axis].max()
        cuts = np.linspace(low, high, 1 + int(np.ceil((high - low) / size)))[1:-1]
        for cut in cuts:
            halves = [half for die in dies for half in die.split_by_plane(tuple(np.eye(3)[axis]), float(cut))]
            dies = [half for half in halves if not half.is_empty()]
    points = [np.asarray(die.to_mesh64().vert_properties)[:, :3] for die in dies]
    centres = np.array([(p.min(axis=0) + p.max(axis=0)) / 2 for p in points])
    radii = np.array([np.linalg.norm(p - c, axis=1).max() for p, c in zip(points, centres, strict=True)])
    return centres, radii


def gather(points: NDArray, sizes: NDArray, size: float) -> Balls:
    """Bigger balls, each around those whose centres lie in one cube about `size` wide."""
    low, extent = points.min(axis=0), np.maximum(np.ptp(points, axis=0), 1e-9)
    counts = np.maximum(np.ceil(extent / size).astype(int), 1)
    index = np.minimum((points - low) / (extent / counts), counts - 1).astype(int)
    order = np.lexsort(index.T[::-1])
    first = np.flatnonzero(np.r_[True, (np.diff(index[order], axis=0) != 0).any(axis=1)])
    groups = np.repeat(np.arange(len(first)), np.diff(np.r_[first, len(points)]))
    centres = (np.minimum.reduceat(points[order], first) + np.maximum.reduceat(points[order], first)) / 2
    radii = np.maximum.reduceat(np.linalg.norm(points[order] - centres[groups], axis=1) + sizes[order], first)
    return centres, radii


def sweep(robot: Robot, carried: list[tuple[Piece, Balls]], wrists: NDArray, opening: float) -> tuple[Balls, NDArray]:
    """Balls, and corners (k, 3) [m], in the carrier's frame, of all that the wrist carries at postures close enough together."""
    arm = arm_of(robot)
    far = max(float(np.linalg.norm(piece.corners, axis=1).max()) for piece, _ in carried) + opening
    postures = _postures(wrists, SWEEP_M / (far + np.linalg.norm(arm.T_links[robot.carrier + 1 :, :3, 3], axis=1).sum()))
    q = np.zeros((len(postures), arm.n))
    q[:, robot.other_index] = postures
    poses = arm.link_poses(q)
    Ts = inverse(poses[:, robot.carrier : robot.carrier + 1]) @ poses

    def everywhere(piece: Piece, points: NDArray) -> NDArray:
        T = Ts[:, piece.link]
        return (np.einsum("nij,kj->nki", T[:, :3, :3], points + piece.slide * opening) + T[:, None, :3, 3]).reshape(-1, 3)

    centres = np.concatenate([everywhere(piece, c) for piece, (c, _) in carried])
    radii = np.concatenate([np.tile(r, len(postures)) for _, (_, r) in carried])
    return (centres, radii + SWEEP_M / 2), np.concatenate([everywhere(piece, piece.corners) for piece, _ in carried])


def _postures(wrists: NDArray, step: float) -> NDArray:
    """Postures (n, joints − 3) along the polyline `wrists`; from one to the next all angles together change by at most `step` [rad]."""
    runs = [wrists[:1]]
    for a, b in pairwise(wrists):
        n = 1 + int(np.ceil(np.abs(b - a).sum() / step))
        runs.append(a + (b - a) * (np.arange(1, n + 1) / n)[:, None])
    return np.concatenate(runs)
