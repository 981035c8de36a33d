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
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.base import Value, frozen_array
from handey_studio.base.compiled import put
from handey_studio.geometry.transforms import inverse
from handey_studio.world import Held, Robot, arm_of
from handey_studio.world.collision_bodies import Piece, held_pieces, robot_pieces

CHIP_EXCESS_M = 0.01  # how far balls reach out of what the wrist carries, before they are gathered into bigger ones
SWEEP_M = 0.01  # how far anything may move from one sampled wrist posture to the next
LINK_EXCESS_M = 0.02  # and out of links: with 3 cm the UR5's shoulder would be in its table
SMALL = 1.5  # excesses: sharp edges are not worth balls that are smaller
STEPS_TO_CENTRE = 100
BALL_SIZES_M = (0.04, 0.05, 0.06, 0.07, 0.08, 0.10, 0.14, 0.20)
MOST_BALLS = 40

Balls = tuple[NDArray, NDArray]  # centres (k, 3), radii (k,) [m]


@dataclass(frozen=True, eq=False)
class WristBox(Value):
    """The box that stands for wrist, hand and part, filled with balls: `centres` (k, 3), `radii` (k,) [m] in the frame of link `carrier`.

    `corners` (8, 3) [m] are the box's. It holds while the joints other than the arm's run through `wrists` (m, joints − 3) [rad].
    """

    centres: NDArray
    radii: NDArray
    corners: NDArray
    carrier: int
    wrists: NDArray

    def __post_init__(self) -> None:
        for key in ("centres", "radii", "corners", "wrists"):
            object.__setattr__(self, key, frozen_array(getattr(self, key), float))


def wrist_box(robot: Robot, wrists: NDArray, opening: float, held: Held | None) -> WristBox:
    """The wrist box while the joints other than the arm's run joint-linearly through `wrists` (m, joints − 3) [rad].

    The fingers are `opening` [m] apart.
    """
    carried = [pair for pair in _robot_balls(robot) if pair[0].link > robot.carrier] + (list(_held_balls(robot, held)) if held else [])
    (points, sizes), ends = sweep(robot, carried, wrists, opening)
    low, high = points.min(axis=0), points.max(axis=0)
    centres, radii, _ = gather(points, sizes, low, high, BALL_SIZES_M[0])
    for size in BALL_SIZES_M[1:]:
        if len(radii) <= MOST_BALLS:
            break
        centres, radii, _ = gather(points, sizes, low, high, size)
    pick = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=bool)
    return WristBox(centres, radii, np.where(pick, ends[1], ends[0]), robot.carrier, wrists)


@lru_cache(maxsize=8)
def link_balls(robot: Robot) -> tuple[NDArray, NDArray, NDArray]:
    """Balls that enclose the links up to the carrier: centres (k, 3) and radii (k,) [m], and the link (k,) in whose frame they are."""
    mine = [(piece.link, balls) for piece, balls in _robot_balls(robot) if 1 <= piece.link <= robot.carrier]
    return (
        np.concatenate([centres for _, (centres, _) in mine]),
        np.concatenate([radii for _, (_, radii) in mine]),
        np.concatenate([np.full(len(radii), link) for link, (_, radii) in mine]),
    )


@lru_cache(maxsize=8)
def _robot_balls(robot: Robot) -> tuple[tuple[Piece, Balls], ...]:
    def excess(link: int) -> float:
        return CHIP_EXCESS_M if link > robot.carrier else LINK_EXCESS_M

    return tuple((piece, balls_around(piece.corners, excess(piece.link))) for piece in robot_pieces(robot))


@lru_cache(maxsize=32)
def _held_balls(robot: Robot, held: Held) -> tuple[tuple[Piece, Balls], ...]:
    return tuple((piece, balls_around(piece.corners, CHIP_EXCESS_M)) for piece in held_pieces(robot, held))


def balls_around(corners: NDArray, excess: float) -> Balls:
    """Balls that together hold a convex body, corners (k, 3) [m], each reaching out of the body by about `excess` [m] at most.

    The body is halved across its longest side until the ball around each piece is that tight or `SMALL`: round links take few.
    """
    planes = ConvexHull(corners).equations
    todo, centres, radii = [manifold3d.Manifold.hull_points(np.array(corners))], [], []
    while todo:
        piece = todo.pop()
        points = np.asarray(piece.to_mesh64().vert_properties)[:, :3]
        centre, radius = _ball_around(points)
        depth = -float((planes[:, :3] @ centre + planes[:, 3]).max())
        if radius - depth <= excess or radius <= SMALL * excess:
            centres.append(centre)
            radii.append(radius)
            continue
        low, high = points.min(axis=0), points.max(axis=0)
        longest = int(np.argmax(high - low))
        halves = piece.split_by_plane(tuple(np.eye(3)[longest]), float((low + high)[longest]) / 2)
        todo += [half for half in halves if not half.is_empty()]
    return np.array(centres), np.array(radii)


@njit(cache=True)
def _ball_around(points: NDArray) -> tuple[NDArray, float]:
    """Centre (3,) and radius [m] of a ball around points (k, 3), nearly the least: the centre steps towards the farthest point, by less and
    less (Bădoiu & Clarkson 2003)."""
    centre, best, least = np.empty(3), np.empty(3), np.inf
    for axis in range(3):
        centre[axis] = (points[:, axis].min() + points[:, axis].max()) / 2
    for step in range(STEPS_TO_CENTRE):
        most, far = -1.0, 0
        for p in range(len(points)):
            x, y, z = points[p, 0] - centre[0], points[p, 1] - centre[1], points[p, 2] - centre[2]
            square = x * x + y * y + z * z
            if square > most:
                most, far = square, p
        if most < least:
            least = most
            put(centre, best)
        centre += (points[far] - centre) * (0.5 / (step + 2))
    return best, np.sqrt(least)


@njit(cache=True)
def gather(points: NDArray, sizes: NDArray, low: NDArray, high: NDArray, size: float) -> tuple[NDArray, NDArray, NDArray]:
    """Bigger balls, each around those balls, `points` (k, 3) and `sizes` (k,), whose centres lie in one cube about `size` wide.

    All centres lie within `low` to `high` (3,). Centres (b, 3) and radii (b,) of the bigger balls, and in which one (k,) each ball is.
    """
    counts, width = np.empty(3, np.int64), np.empty(3)
    for axis in range(3):
        counts[axis] = max(int(np.ceil((high[axis] - low[axis]) / size)), 1)
        width[axis] = max(high[axis] - low[axis], 1e-9) / counts[axis]
    cubes = counts[0] * counts[1] * counts[2]
    number, cube_of, found = np.full(cubes, -1), np.empty(len(points), np.int64), 0
    lower, upper = np.full((cubes, 3), np.inf), np.full((cubes, 3), -np.inf)
    for p in range(len(points)):
        cube = 0
        for axis in range(3):
            cube = cube * counts[axis] + min(int((points[p, axis] - low[axis]) / width[axis]), counts[axis] - 1)
        if number[cube] < 0:
            number[cube] = found
            found += 1
        cube_of[p] = number[cube]
        for axis in range(3):
            lower[cube_of[p], axis] = min(lower[cube_of[p], axis], points[p, axis])
            upper[cube_of[p], axis] = max(upper[cube_of[p], axis], points[p, axis])
    centres, radii = (lower[:found] + upper[:found]) / 2, np.zeros(found)
    for p in range(len(points)):
        c = cube_of[p]
        x, y, z = points[p, 0] - centres[c, 0], points[p, 1] - centres[c, 1], points[p, 2] - centres[c, 2]
        radii[c] = max(radii[c], np.sqrt(x * x + y * y + z * z) + sizes[p])
    return centres, radii, cube_of


def sweep(robot: Robot, carried: list[tuple[Piece, Balls]], wrists: NDArray, opening: float) -> tuple[Balls, NDArray]:
    """Balls, and the lower and upper corner (2, 3) [m] of the box, in the carrier's frame, of all that the wrist carries on its way."""
    arm = arm_of(robot)
    far = max(float(np.linalg.norm(piece.corners, axis=1).max()) for piece, _ in carried) + opening
    postures = _postures(wrists, SWEEP_M / (far + np.linalg.norm(arm.T_links[robot.carrier + 1 :, :3, 3], axis=1).sum()))
    q = np.zeros((len(postures), arm.n))
    q[:, robot.other_index] = postures
    poses = arm.link_poses(q)
    Ts = inverse(poses[:, robot.carrier : robot.carrier + 1]) @ poses

    def everywhere(points: list[NDArray]) -> NDArray:
        links = np.concatenate([np.full(len(p), piece.link) for p, (piece, _) in zip(points, carried, strict=True)])
        slid = np.concatenate([p + piece.slide * opening for p, (piece, _) in zip(points, carried, strict=True)])
        return _everywhere(Ts, links, slid)

    centres = everywhere([c for _, (c, _) in carried])
    radii = np.tile(np.concatenate([r for _, (_, r) in carried]), len(postures))
    corners = everywhere([piece.corners for piece, _ in carried])
    return (centres, radii + SWEEP_M / 2), np.array([corners.min(axis=0) - SWEEP_M / 2, corners.max(axis=0) + SWEEP_M / 2])


@njit(cache=True)
def _everywhere(Ts: NDArray, links: NDArray, points: NDArray) -> NDArray:
    """Points (k, 3), each on its link, at all n postures: (n·k, 3)."""
    n, k = len(Ts), len(points)
    out = np.empty((n * k, 3))
    for posture in range(n):
        for p in range(k):
            T = Ts[posture, links[p]]
            for axis in range(3):
                out[posture * k + p, axis] = T[axis, 0] * points[p, 0] + T[axis, 1] * points[p, 1] + T[axis, 2] * points[p, 2] + T[axis, 3]
    return out


def _postures(wrists: NDArray, step: float) -> NDArray:
    """Postures (n, joints − 3) along the polyline `wrists`; from one to the next all angles together change by at most `step` [rad]."""
    runs = [wrists[:1]]
    for a, b in pairwise(wrists):
        n = 1 + int(np.ceil(np.abs(b - a).sum() / step))
        runs.append(a + (b - a) * (np.arange(1, n + 1) / n)[:, None])
    return np.concatenate(runs)
