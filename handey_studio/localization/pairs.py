"""Pairs of edges by their relative pose α, d, a₁, a₂ (Handey 1987 §3, Figure 3): the model's table, and the data's pairs."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.geometry.lines import RelativePose, relative_pose
from handey_studio.localization.edges import KIND_NAMES
from handey_studio.localization.segments import DataEdge
from handey_studio.world.part import Part

MIN_ALPHA = np.deg2rad(25.0)  # nearer to parallel, the foot of the common perpendicular is too uncertain
SHARP = np.deg2rad(15.0)  # model edges blunter than this make no crease that could be found
SAME_M, SAME_RAD = 1e-5, 1e-6


class ModelEdges(NamedTuple):
    """The part's edges as arrays, in its frame: `middle`, unit `direction` (n, 3), `half` length (n,) [m], outward
    normals of the faces to the `left` and `right` (n, 3), and whether the edge is `concave` (n,)."""

    middle: NDArray
    direction: NDArray
    half: NDArray
    left: NDArray
    right: NDArray
    concave: NDArray


class DataLines(NamedTuple):
    """The data edges as arrays, in the sensor's frame: `middle`, unit `direction` (n, 3), `half` length (n,) [m], `kind`
    (n,), up to two flanks each: normals `flank` (n, 2, 3) and `side` (n, 2), +1 if that surface is left of the direction,
    −1 right, 0 none."""

    middle: NDArray
    direction: NDArray
    half: NDArray
    kind: NDArray
    flank: NDArray
    side: NDArray
    offset_sigma: NDArray
    angle_sigma: NDArray


class Pairs(NamedTuple):
    """Pairs of edges `first`, `second` (n,) and their relative pose (n,); feet count from the edges' middles, so that
    a₁ and a₂, the distances to the nearest ends, are |half − |foot||."""

    first: NDArray
    second: NDArray
    alpha: NDArray
    d: NDArray
    foot1: NDArray
    foot2: NDArray

    def rows(self, chosen: NDArray) -> "Pairs":
        """Some of the pairs."""
        return Pairs(*(array[chosen] for array in self))


class ParallelPairs(NamedTuple):
    """Pairs of parallel edges `first`, `second` (n,): `across` (n, 3) the unit direction from the first line to the second, `d` (n,) [m]
    how far apart they are, and `ahead` (n,) [m] by how much the second's middle lies ahead of the first's along the first's direction."""

    first: NDArray
    second: NDArray
    across: NDArray
    d: NDArray
    ahead: NDArray

    def rows(self, chosen: NDArray) -> "ParallelPairs":
        """Some of the pairs."""
        return ParallelPairs(*(array[chosen] for array in self))


@lru_cache(maxsize=64)
def model_edges(part: Part) -> ModelEdges:
    """The edges of a part that can be seen as edges."""
    solid = part.solid
    kept = [edge for edge in solid.edges if abs(edge.dihedral) > SHARP]
    start, end = (solid.vertices[[getattr(edge, key) for edge in kept]] for key in ("start", "end"))
    lengths = np.linalg.norm(end - start, axis=1)
    left, right = (solid.normals[[getattr(edge, key) for edge in kept]] for key in ("left", "right"))
    concave = np.array([edge.dihedral < 0 for edge in kept])
    return ModelEdges((start + end) / 2, (end - start) / lengths[:, None], lengths / 2, left, right, concave)


@lru_cache(maxsize=64)
def model_pairs(part: Part) -> Pairs:
    """The part's ordered pairs of edges that are not parallel, one of each that its symmetries map onto one another."""
    edges = model_edges(part)
    first, second = (index.reshape(-1) for index in np.indices((len(edges.half),) * 2))
    pairs = _pairs(edges.middle, edges.direction, first, second)
    keep = _foremost(part, edges, pairs.first, pairs.second)
    return pairs.rows(keep)


@lru_cache(maxsize=64)
def model_parallels(part: Part) -> ParallelPairs:
    """The part's ordered pairs of parallel edges on different lines, one of each that its symmetries map onto one another."""
    edges = model_edges(part)
    first, second = (index.reshape(-1) for index in np.indices((len(edges.half),) * 2))
    pairs = _parallels(edges.middle, edges.direction, first, second, SAME_RAD)
    keep = _foremost(part, edges, pairs.first, pairs.second) & (pairs.d > SAME_M)
    return pairs.rows(keep)


def _foremost(part: Part, edges: ModelEdges, first: NDArray, second: NDArray) -> NDArray:
    """Which ordered pairs (n,) of edges come first among their images under the part's symmetries."""
    n = len(edges.half)
    images = [_image(edges, T) for T in part.symmetries]
    return np.min([image[first] * n + image[second] for image in images], axis=0) == first * n + second


def data_lines(edges: tuple[DataEdge, ...]) -> DataLines:
    """Data edges as arrays."""
    n = len(edges)
    kind = np.array([KIND_NAMES.index(edge.kind) for edge in edges], dtype=np.int64)
    ends = np.array([edge.ends_sensor for edge in edges]).reshape(n, 2, 3)
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    direction = along / length[:, None]
    flanks = np.array([len(edge.normals_sensor) for edge in edges], dtype=int)
    seen = np.arange(2) < flanks[:, None]  # (n, 2)
    flank, inward, side = np.zeros((n, 2, 3)), np.zeros((n, 2, 3)), np.zeros((n, 2))
    flank[seen] = np.concatenate([np.zeros((0, 3)), *(edge.normals_sensor for edge in edges)])
    inward[seen] = np.concatenate([np.zeros((0, 3)), *(edge.inward_sensor for edge in edges)])
    left = np.einsum("nki,nki->nk", inward, np.cross(flank, direction[:, None]))
    side[seen] = np.where(left[seen] > 0, 1.0, -1.0)
    offset, angle = (np.array([getattr(edge, key) for edge in edges]) for key in ("offset_sigma", "angle_sigma"))
    return DataLines(ends.mean(axis=1), direction, length / 2, kind, flank, side, offset, angle)


def data_pairs(lines: DataLines, reach: float) -> Pairs:
    """Pairs of data edges that are not parallel and whose ends lie within `reach` [m] of one another, long ones first."""
    first, second = _together(lines.middle, lines.direction, lines.half, reach)
    order = np.argsort(-np.minimum(lines.half[first], lines.half[second]), kind="stable")
    return _pairs(lines.middle, lines.direction, first[order], second[order])


def data_parallels(lines: DataLines, reach: float, angle: float) -> ParallelPairs:
    """Pairs of data edges that are parallel to within `angle` [rad] and whose ends lie within `reach` [m], long ones first."""
    first, second = _together(lines.middle, lines.direction, lines.half, reach)
    order = np.argsort(-np.minimum(lines.half[first], lines.half[second]), kind="stable")
    return _parallels(lines.middle, lines.direction, first[order], second[order], angle)


def _parallels(middle: NDArray, direction: NDArray, first: NDArray, second: NDArray, angle: float) -> ParallelPairs:
    cosine = np.einsum("ij,ij->i", direction[first], direction[second])
    first, second, cosine = (array[np.abs(cosine) >= np.cos(angle)] for array in (first, second, cosine))
    # both lines' mean direction: neither alone is as good
    along = direction[first] + np.sign(cosine)[:, None] * direction[second]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    between = middle[second] - middle[first]
    ahead = np.einsum("ij,ij->i", between, along)
    across = between - ahead[:, None] * along
    d = np.linalg.norm(across, axis=1)
    return ParallelPairs(first, second, across / np.maximum(d, 1e-12)[:, None], d, ahead)


@njit(cache=True)
def _together(middle: NDArray, direction: NDArray, half: NDArray, reach: float) -> tuple[NDArray, NDArray]:
    """Numbers of two edges each, of which every end is within `reach` [m] of the other's ends: one part could hold both."""
    n = len(half)
    first, second = np.empty(n * (n - 1) // 2, dtype=np.int64), np.empty(n * (n - 1) // 2, dtype=np.int64)
    count = 0
    for i in range(n):
        for j in range(i + 1, n):
            near = True
            for s in (-1.0, 1.0):
                for w in (-1.0, 1.0):
                    squared = 0.0
                    for r in range(3):
                        apart = middle[i, r] + s * half[i] * direction[i, r] - middle[j, r] - w * half[j] * direction[j, r]
                        squared += apart * apart
                    near = near and squared <= reach * reach
            if near:
                first[count], second[count] = i, j
                count += 1
    return first[:count], second[:count]


def _pairs(middle: NDArray, direction: NDArray, first: NDArray, second: NDArray) -> Pairs:
    relative: RelativePose = relative_pose(middle[first], direction[first], middle[second], direction[second])
    skew = (relative.alpha > MIN_ALPHA) & (relative.alpha < np.pi - MIN_ALPHA)
    return Pairs(first[skew], second[skew], relative.alpha[skew], relative.d[skew], relative.foot1[skew], relative.foot2[skew])


def _image(edges: ModelEdges, T: NDArray) -> NDArray:
    """Where a symmetry takes each edge (n,)."""
    moved = edges.middle @ T[:3, :3].T + T[:3, 3]
    turned = edges.direction @ T[:3, :3].T
    distance = np.linalg.norm(moved[:, None] - edges.middle[None], axis=2)
    across = 1.0 - np.abs(turned @ edges.direction.T)
    return np.argmin(distance + across, axis=1)
