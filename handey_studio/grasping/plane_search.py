"""A search of all motions in the grasp plane: the configuration space y, z, θ of the hand among the filled cells.

What the bump lines (Handey 1987 §5.2) only hope for, that the hand does not get stuck, this settles at its resolution: a way is
found if there is one that keeps the hand a little more than `margin` away from filled cells, and a way that is found is free.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.grasping.grasp_plane import GraspPlane
from handey_studio.grasping.hand_outline import Outline

BIN_M = 0.001  # filled cells are counted in bins of this size, turned with the hand


@dataclass(frozen=True)
class SearchOptions:
    """Lattice of fingertip positions `step` [m] and hand angles `turn` [rad] apart, within `radius` [m] and `reach` [rad] of the root; the
    hand keeps `margin` [m] from filled cells. The hand alone is out when its fingertips are `out` [m] from the root."""

    step: float = 0.0025
    turn: float = float(np.deg2rad(5.0))
    radius: float = 0.10
    reach: float = float(np.deg2rad(75.0))
    margin: float = 0.001
    out: float = 0.08


class PlaneSpace(NamedTuple):
    """Configuration space around a root pose (3,): `blocked` (angles, n, n), the middle of every axis being the root itself."""

    root: NDArray
    blocked: NDArray
    step: float
    turn: float

    def poses(self, nodes: NDArray) -> NDArray:
        """Poses (..., 3) of nodes (..., 3): counts along the axes of `blocked`."""
        offsets = np.asarray(nodes) - np.array(self.blocked.shape) // 2
        return self.root + np.stack([offsets[..., 1] * self.step, offsets[..., 2] * self.step, offsets[..., 0] * self.turn], axis=-1)

    def node(self, pose: NDArray) -> NDArray:
        """The node (3,) nearest to a pose; it may lie outside."""
        y, z, angle = pose - self.root
        return np.round([angle / self.turn, y / self.step, z / self.step]).astype(int) + np.array(self.blocked.shape) // 2

    @property
    def angles(self) -> NDArray:
        """Hand angles [rad] of the first axis."""
        return self.root[2] + (np.arange(len(self.blocked)) - len(self.blocked) // 2) * self.turn


def plane_space(
    plane: GraspPlane, outline: Outline, root: NDArray, options: SearchOptions = SearchOptions(), inside: bool = False
) -> PlaneSpace:
    """Which lattice poses around `root` (y, z, angle) are blocked: where a filled cell comes within the margin of the outline.

    On the safe side by at most a bin and a half cell. Two free neighbours on the lattice are joined by free motion: a convex outline that
    moves by a step to both sides at once passes what neither end comes within half a step of. A pose wholly inside filled cells, where
    no motion leads, is told only if asked for.
    """
    margin = max(options.margin, 0.5 * options.step)
    count, angles = int(options.radius / options.step), int(options.reach / options.turn + 1e-9)
    blocked = np.ones((2 * angles + 1, 2 * count + 1, 2 * count + 1), dtype=np.bool_)
    root = np.array(root, dtype=float)
    for volume, filled in enumerate(plane.filled.volumes):
        mine = outline.bounds[outline.volumes == volume]
        if len(mine):
            centres = plane.origin + (np.argwhere(filled if inside else _rim(filled)) + 0.5) * plane.cell - root[:2]
            _block(blocked, volume == 0, centres, plane.cell, mine, root[2], options.step, options.turn, margin)
    _block_beyond(blocked, plane.origin - root[:2], len(plane.fingers) * plane.cell, outline.bounds, root[2], options.step, options.turn)
    return PlaneSpace(root, blocked, options.step, options.turn)


def way_out(space: PlaneSpace, sources: NDArray, cost: NDArray) -> NDArray:
    """The nodes (k, 3) of the way from one of `sources` (s, 3) to the best node that is out; empty if there is none.

    `cost` (angles, n, n) [m] is added to the length of the way to each node: smaller is better, and infinite where it is not out yet.
    """
    steps = _flood(space.blocked, sources)
    total = np.where(steps >= 0, steps * space.step + cost, np.inf)
    best = np.unravel_index(int(np.argmin(total)), total.shape)
    return _trace(steps, np.array(best))[::-1] if np.isfinite(total[best]) else np.empty((0, 3), dtype=int)


def beyond(space: PlaneSpace, out: float) -> NDArray:
    """Which nodes (n, n) of each angle are at least `out` [m] from the root."""
    y, z = (np.arange(n) - n // 2 for n in space.blocked.shape[1:])
    return np.hypot(y[:, None], z[None, :]) * space.step >= out


def _rim(filled: NDArray) -> NDArray:
    """The filled cells (n, n) that have an empty neighbour: whoever meets the inside has met these before."""
    inside = np.zeros_like(filled)
    inside[1:-1, 1:-1] = filled[1:-1, 1:-1] & filled[:-2, 1:-1] & filled[2:, 1:-1] & filled[1:-1, :-2] & filled[1:-1, 2:]
    return filled & ~inside


@njit(cache=True)
def _block(
    blocked: NDArray, first: bool, centres: NDArray, cell: float, bounds: NDArray, angle: float, step: float, turn: float, margin: float
) -> None:
    """Block the poses whose rectangles, grown by the margin and half a cell, hold the centre of a filled cell; `first` opens all others.

    For each angle the centres (n, 2), from the root, are counted in bins along the hand, and the counts summed up from one corner on.
    """
    angles, n = blocked.shape[0], blocked.shape[1]
    half = n // 2
    radius = half * step
    low_a, high_a = bounds[:, 0].min() - radius, bounds[:, 1].max() + radius
    low_b, high_b = bounds[:, 2].min() - radius, bounds[:, 3].max() + radius
    spare = margin + 2 * cell
    rows, columns = int((high_a - low_a + 2 * spare) / BIN_M) + 2, int((high_b - low_b + 2 * spare) / BIN_M) + 2
    sums = np.zeros((rows + 1, columns + 1), np.int32)
    for k in range(angles):
        theta = angle + (k - angles // 2) * turn
        c, s = np.cos(theta), np.sin(theta)
        grown = margin + 0.5 * cell * (abs(c) + abs(s))
        sums[:] = 0
        for p in range(len(centres)):
            i = int(np.floor((c * centres[p, 1] - s * centres[p, 0] - low_a + spare) / BIN_M))
            j = int(np.floor((c * centres[p, 0] + s * centres[p, 1] - low_b + spare) / BIN_M))
            if 0 <= i < rows and 0 <= j < columns:
                sums[i + 1, j + 1] += 1
        for i in range(rows):
            row = 0
            for j in range(columns):
                row += sums[i + 1, j + 1]
                sums[i + 1, j + 1] = sums[i, j + 1] + row
        for y in range(n):
            for z in range(n):
                u, v = (y - half) * step, (z - half) * step
                if u * u + v * v > radius * radius or (blocked[k, y, z] and not first):
                    continue
                a, b = c * v - s * u - low_a + spare, c * u + s * v - low_b + spare
                met = False
                for r in range(len(bounds)):
                    i0, i1 = int((a + bounds[r, 0] - grown) / BIN_M), int((a + bounds[r, 1] + grown) / BIN_M) + 1
                    j0, j1 = int((b + bounds[r, 2] - grown) / BIN_M), int((b + bounds[r, 3] + grown) / BIN_M) + 1
                    if sums[i1, j1] - sums[i0, j1] - sums[i1, j0] + sums[i0, j0] > 0:
                        met = True
                        break
                blocked[k, y, z] = met


@njit(cache=True)
def _block_beyond(blocked: NDArray, low: NDArray, size: float, bounds: NDArray, angle: float, step: float, turn: float) -> None:
    """Block the poses at which a corner of the outline lies beyond the plane's rectangle, which begins at `low` (2,) from the root."""
    angles, n = blocked.shape[0], blocked.shape[1]
    for k in range(angles):
        theta = angle + (k - angles // 2) * turn
        c, s = np.cos(theta), np.sin(theta)
        low_y, high_y, low_z, high_z = np.inf, -np.inf, np.inf, -np.inf
        for r in range(len(bounds)):
            for corner in range(4):
                a, b = bounds[r, corner % 2], bounds[r, 2 + corner // 2]
                low_y, high_y = min(low_y, c * b - s * a), max(high_y, c * b - s * a)
                low_z, high_z = min(low_z, s * b + c * a), max(high_z, s * b + c * a)
        for i in range(n):
            y = (i - n // 2) * step
            for j in range(n):
                z = (j - n // 2) * step
                if low_y + y < low[0] or high_y + y > low[0] + size or low_z + z < low[1] or high_z + z > low[1] + size:
                    blocked[k, i, j] = True


def _flood(blocked: NDArray, sources: NDArray) -> NDArray:
    """Least number of moves (angles, n, n) from any of the sources (s, 3); -1 where no way leads.

    A move goes to one of eight neighbours in the plane, or turns by one step.
    """
    walled = np.pad(blocked, 1, constant_values=True)
    row, layer = walled.shape[2], walled.shape[1] * walled.shape[2]
    moves = np.array([1, -1, row, -row, row + 1, row - 1, 1 - row, -row - 1, layer, -layer])
    starts = (np.asarray(sources, dtype=np.int64).reshape(-1, 3) + 1) @ np.array([layer, row, 1])
    steps = _spread(walled.ravel(), starts, moves).reshape(walled.shape)
    return steps[1:-1, 1:-1, 1:-1]


@njit(cache=True)
def _spread(blocked: NDArray, starts: NDArray, moves: NDArray) -> NDArray:
    """`_flood` over the flat cells, whose border is blocked."""
    steps = np.full(len(blocked), -1, np.int32)
    queue = np.empty(len(blocked), np.int64)
    head, tail = 0, 0
    for start in starts:
        if not blocked[start] and steps[start] < 0:
            steps[start], queue[tail], tail = 0, start, tail + 1
    while head < tail:
        node, head = queue[head], head + 1
        for move in moves:
            other = node + move
            if not blocked[other] and steps[other] < 0:
                steps[other], queue[tail], tail = steps[node] + 1, other, tail + 1
    return steps


def _trace(steps: NDArray, node: NDArray) -> NDArray:
    """Nodes (k, 3) from a node downhill to a source."""
    around = np.array([move for move in np.ndindex(3, 3, 3) if (move[0] == 1) != (move[1:] == (1, 1))]) - 1
    nodes = [node]
    while (left := steps[tuple(nodes[-1])]) > 0:
        near = nodes[-1] + around
        near = near[((near >= 0) & (near < steps.shape)).all(axis=1)]
        nodes.append(near[int(np.argmax(steps[tuple(near.T)] == left - 1))])
    return np.array(nodes)
