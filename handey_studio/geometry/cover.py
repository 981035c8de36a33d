"""A few convex pieces that together hold a solid, with little air in them.

The solid is cut by planes across its axes, each time where the hulls of the halves hold the least: greedy, as Lien & Amato's approximate
convex decomposition (2007) is, with a count of volume in place of their measure of concavity.
"""

from dataclasses import dataclass

import manifold3d
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from handey_studio.base import frozen_array


@dataclass(frozen=True)
class CoverOptions:
    """A cut must take off `least_air` [m³], what a cube of 3 cm holds; `most` pieces; planes tried an axis and their least spacing [m]."""

    least_air: float = 27e-6
    most: int = 8
    planes: int = 15
    spacing: float = 0.01


@dataclass(frozen=True)
class _Cut:
    """A plane across an axis at a place [m], and the volume [m³] that the hulls of the two halves save."""

    saves: float
    axis: int = 0
    place: float = 0.0


def convex_cover(vertices: NDArray, triangles: NDArray, options: CoverOptions = CoverOptions()) -> tuple[NDArray, ...]:
    """Corners (k, 3) [m] of convex pieces that together hold the solid inside a surface: vertices (n, 3) [m], triangles (m, 3).

    The surface may be several closed ones that cross each other. One that does not close is cut across its longest side only, where the
    hull of what of the surface is in a slab holds all that it encloses there.
    """
    solid = _solid(vertices, triangles)
    if solid is None:
        return _slabs(vertices, _edges(triangles), options)
    pieces = [(solid, _best_cut(solid, options))]
    while len(pieces) < options.most:
        piece, cut = max(pieces, key=lambda pair: pair[1].saves)
        if cut.saves < options.least_air:
            break
        pieces = [pair for pair in pieces if pair[0] is not piece]
        halves = piece.split_by_plane(tuple(np.eye(3)[cut.axis]), cut.place)
        pieces += [(half, _best_cut(half, options)) for half in halves if not half.is_empty()]
    return tuple(_hull_corners(piece) for piece, _ in pieces)


def _solid(vertices: NDArray, triangles: NDArray) -> manifold3d.Manifold | None:
    """The solid; None when the surface does not close."""
    whole = manifold3d.Manifold(manifold3d.Mesh64(np.array(vertices, dtype=float), np.array(triangles, dtype=np.uint64)))
    if whole.is_empty() or whole.volume() <= 0:
        return None
    return manifold3d.Manifold.batch_boolean(whole.decompose(), manifold3d.OpType.Add)


def _arrays(solid: manifold3d.Manifold) -> tuple[NDArray, NDArray]:
    mesh = solid.to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, dtype=np.int64)


def _hull_corners(solid: manifold3d.Manifold) -> NDArray:
    points = _arrays(solid)[0]
    return frozen_array(points[ConvexHull(points).vertices])


def _best_cut(solid: manifold3d.Manifold, options: CoverOptions) -> _Cut:
    """The cut that saves most; one that saves nothing when the piece is all but its own hull."""
    points, triangles = _arrays(solid)
    edges = _edges(triangles)
    whole = _hull_volume(points)
    best = _Cut(0.0)
    if whole - solid.volume() < options.least_air:
        return best
    for axis in range(3):
        for place in _places(points[:, axis].min(), points[:, axis].max(), options):
            crossing = _crossing(points, edges, axis, place)
            above = points[:, axis] >= place
            halves = (np.concatenate([points[side], crossing]) for side in (above, ~above))
            saves = whole - sum(_hull_volume(half) for half in halves)
            if saves > best.saves:
                best = _Cut(saves, axis, float(place))
    return best


def _slabs(points: NDArray, edges: NDArray, options: CoverOptions) -> tuple[NDArray, ...]:
    """Corners (k, 3) [m] of the hulls of slabs of a surface across its longest side, cut where that saves most."""
    axis = int(np.argmax(np.ptp(points, axis=0)))

    def within(low: float, high: float) -> NDArray:
        inside = points[(points[:, axis] >= low) & (points[:, axis] <= high)]
        return np.concatenate([inside, _crossing(points, edges, axis, low), _crossing(points, edges, axis, high)])

    def best(low: float, high: float) -> tuple[float, float]:
        whole = _hull_volume(within(low, high))
        saved = [(whole - _hull_volume(within(low, p)) - _hull_volume(within(p, high)), float(p)) for p in _places(low, high, options)]
        return max(saved, default=(0.0, low))

    ends = (float(points[:, axis].min()), float(points[:, axis].max()))
    slabs = {ends: best(*ends)}
    while len(slabs) < options.most:
        (low, high), (saves, place) = max(slabs.items(), key=lambda slab: slab[1][0])
        if saves < options.least_air:
            break
        del slabs[low, high]
        slabs |= {half: best(*half) for half in ((low, place), (place, high))}
    hulls = [within(*slab) for slab in sorted(slabs)]
    return tuple(frozen_array(hull[ConvexHull(hull).vertices]) for hull in hulls)


def _places(low: float, high: float, options: CoverOptions) -> NDArray:
    """Where a cut between two ends [m] is tried."""
    count = min(options.planes, int((high - low) / options.spacing) - 1)
    return np.linspace(low, high, max(count, 0) + 2)[1:-1]


def _edges(triangles: NDArray) -> NDArray:
    """The edges (e, 2) of triangles (m, 3), each once."""
    return np.unique(np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1), axis=0)


def _crossing(points: NDArray, edges: NDArray, axis: int, place: float) -> NDArray:
    """Where edges (e, 2) between points (n, 3) cross a plane."""
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    across = (a[:, axis] >= place) != (b[:, axis] >= place)
    a, b = a[across], b[across]
    share = (place - a[:, axis]) / (b[:, axis] - a[:, axis])
    return a + share[:, None] * (b - a)


def _hull_volume(points: NDArray) -> float:
    try:
        return float(ConvexHull(points).volume)
    except QhullError:
        return 0.0
