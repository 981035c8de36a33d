"""The outline of the hand, and of what it holds, in the grasp plane: rectangles that lie along the fingers (Handey 1987 §5.2)."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.geometry.transforms import apply
from handey_studio.grasping.grasp_plane import Filled, GraspPlane
from handey_studio.world import Hand, Held

VOLUMES = ("fingers", "crosspiece", "mount", "held")
SPACING = 0.7  # of a cell, between points that are looked up: no cell slips through between them
STRIP_M = 0.004  # what is held is cut across into strips of this width


class Outline(NamedTuple):
    """Rectangles of the hand's frame in the plane: `volumes` (r,) counts in `VOLUMES`, `bounds` (r, 4) [m] from and to across the fingers,
    and from and to along them, whose tips are at 0."""

    volumes: NDArray
    bounds: NDArray


def hand_rectangles(hand: Hand) -> list[tuple[str, float, float, float]]:
    """(volume, half width, from, to) [m]: the hand's outline in the grasp plane, along the fingers from their tips at 0."""
    back = -hand.finger_length - hand.crosspiece_height
    rectangles = [
        ("fingers", hand.finger_width / 2.0, -hand.finger_length, 0.0),
        ("crosspiece", hand.crosspiece_width / 2.0, back, -hand.finger_length),
    ]
    mount = -float(hand.T_flange_hand[2, 3])
    return [*rectangles, ("mount", hand.mount_radius, mount, back)] if mount < back else rectangles


def hand_outline(hand: Hand) -> Outline:
    """The open hand."""
    rectangles = hand_rectangles(hand)
    bounds = np.array([[-half, half, low, high] for _, half, low, high in rectangles])
    return Outline(np.array([VOLUMES.index(volume) for volume, *_ in rectangles]), bounds)


def outline_with(hand: Hand, held: Held, side: int = 1) -> tuple[Outline, tuple[float, float]]:
    """The hand with what it holds, and where that begins and ends along the plane's x [m]; `side` as in `hand_in_plane`."""
    strips, ends = [], []
    for piece in held.part.pieces:
        x, y, z = apply(held.T_hand_part, piece).T
        ends += [side * x.min(), side * x.max()]
        strips += _strips(np.stack([-side * y, z], axis=1))
    alone = hand_outline(hand)
    volumes = np.concatenate([alone.volumes, np.full(len(strips), VOLUMES.index("held"))])
    return Outline(volumes, np.concatenate([alone.bounds, np.array(strips)])), (float(min(ends)), float(max(ends)))


def _strips(points: NDArray) -> list[NDArray]:
    """Rectangles (4,) that together cover the hull of points (n, 2), each as wide as the hull is somewhere along it."""
    count = max(1, int(np.ceil(np.ptp(points[:, 1]) / STRIP_M)))
    edges = np.linspace(points[:, 1].min(), points[:, 1].max(), count + 1)
    one, other = (points[index] for index in np.triu_indices(len(points), 1))
    strips = []
    for low, high in pairwise(edges):
        across = [points[(points[:, 1] >= low) & (points[:, 1] <= high), 0]]
        for edge in (low, high):
            pierced = (one[:, 1] - edge) * (other[:, 1] - edge) < 0
            share = (edge - one[pierced, 1]) / (other[pierced, 1] - one[pierced, 1])
            across.append(one[pierced, 0] + share * (other[pierced, 0] - one[pierced, 0]))
        found = np.concatenate(across)
        strips.append(np.array([found.min(), found.max(), low, high]))
    return strips


def overlaps(plane: GraspPlane, outline: Outline, pose: NDArray, margin: float = 0.0) -> bool:
    """Whether the outline, grown by `margin` [m], lies on a filled cell at a pose (y, z, angle); outside the plane all is filled."""
    return bool(meets(plane.filled, outline, np.array(pose, dtype=float), margin))


@njit(cache=True)
def meets(filled: Filled, outline: Outline, pose: NDArray, margin: float) -> bool:
    """`overlaps` over the filled cells of a plane."""
    for r in range(len(outline.volumes)):
        a0, a1, b0, b1 = outline.bounds[r]
        if rectangle_meets(filled, outline.volumes[r], pose, a0 - margin, a1 + margin, b0 - margin, b1 + margin):
            return True
    return False


@njit(cache=True)
def rectangle_meets(filled: Filled, volume: int, pose: NDArray, a0: float, a1: float, b0: float, b1: float) -> bool:
    """Whether a rectangle of the hand's frame, a0 ≤ across ≤ a1 and b0 ≤ along ≤ b1 (a line if flat), meets a filled cell or the border."""
    grid, cell = filled.volumes[volume], filled.cell
    c, s = np.cos(pose[2]), np.sin(pose[2])
    columns, rows = int(np.ceil((a1 - a0) / (SPACING * cell))), int(np.ceil((b1 - b0) / (SPACING * cell)))
    for k in range(columns + 1):
        a = a0 + (a1 - a0) * k / max(columns, 1)
        for m in range(rows + 1):
            b = b0 + (b1 - b0) * m / max(rows, 1)
            i = int(np.floor((pose[0] - s * a + c * b - filled.origin[0]) / cell))
            j = int(np.floor((pose[1] + c * a + s * b - filled.origin[1]) / cell))
            if i < 0 or j < 0 or i >= len(grid) or j >= len(grid) or grid[i, j]:
                return True
    return False
