"""Which readings of a scan are of the object that a model stands for; the others are left out openly, each with its reason.

Readings above the support fall into connected pieces, split at depth jumps. A piece is the object's if enough of it lies near the model.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.geometry.distances import Surface, signed_distances
from handey_studio.geometry.transforms import apply
from handey_studio.modeling.scans import Scan
from handey_studio.sensing.drawing import camera_of
from handey_studio.sensing.facets import sigma_at
from handey_studio.sensing.view_map import STEEP_PX, STEEP_SIGMAS

ON_SUPPORT, OTHER, ALONE, FAR = "on or below the support", "another object", "alone at a jump", "far from the model"
ABOVE_SIGMAS = 4.0  # of noise, which the support's own readings stay below
LEAST_PIECE = 8  # readings; fewer are what a sensor invents at a jump
NEAR_SHARE = 0.05  # of a piece's readings must lie near the model


class Readings(NamedTuple):
    """The object's readings: pixels (n, 2) as row and column, points (n, 3) [m] in the model frame, signed distances (n,) [m] from the
    model, nearest faces (n,), each one's noise (n,) [m], and (reason, count) of those left out."""

    pixels: NDArray
    points: NDArray
    distances: NDArray
    faces: NDArray
    sigmas: NDArray
    left_out: tuple[tuple[str, int], ...]


def object_readings(
    scan: Scan, T_model_scan: NDArray, surface: Surface, corners: NDArray, reach: float, least_height: float, mask: NDArray | None
) -> Readings:
    """The readings of a scan that the model with these corners (k, 3) [m] should explain.

    Higher than `least_height` [m], and than the noise, above the support, in a piece that comes within `reach` [m] of the surface; or,
    where a `mask` (H, W) tells the object's readings, those in it.
    """
    view = scan.view
    pieces, below = _pieces_of(scan, max(least_height, ABOVE_SIGMAS * view.noise))
    v, u = np.nonzero(pieces >= 0)
    piece, depth = pieces[v, u], view.depth[v, u]
    uv = np.stack([u, v], axis=-1).astype(float)
    points = apply(T_model_scan @ view.T_world_sensor, view.projection.unproject(uv, depth))
    sizes = np.bincount(piece, minlength=1)
    masked = np.ones(len(v), dtype=bool) if mask is None else np.asarray(mask, dtype=bool)[v, u]
    alone = masked & (sizes[piece] < LEAST_PIECE)
    asked = masked & ~alone
    if mask is None:
        low, high = corners.min(axis=0) - reach, corners.max(axis=0) + reach
        beside = (points >= low).all(axis=1) & (points <= high).all(axis=1)
        asked &= _share_of(piece, beside, sizes)[piece] > 0.0
    distances, faces = np.full(len(v), np.inf), np.full(len(v), -1)
    distances[asked], faces[asked] = signed_distances(surface, points[asked])
    if mask is None:
        asked &= _share_of(piece, np.abs(distances) <= reach, sizes)[piece] >= NEAR_SHARE
    diameter = float(np.linalg.norm(np.ptp(corners, axis=0)))
    near = asked & (np.abs(distances) <= max(diameter / 2.0, reach))
    counts = ((ON_SUPPORT, below), (OTHER, len(v) - alone.sum() - asked.sum()), (ALONE, alone.sum()), (FAR, asked.sum() - near.sum()))
    return Readings(
        np.stack([v, u], axis=-1)[near],
        points[near],
        distances[near],
        faces[near],
        sigma_at(view, depth[near]),
        tuple((reason, int(count)) for reason, count in counts if count),
    )


def _share_of(piece: NDArray, chosen: NDArray, sizes: NDArray) -> NDArray:
    """Which share of each piece's readings was chosen."""
    return np.bincount(piece, weights=chosen, minlength=len(sizes)) / np.maximum(sizes, 1)


def _pieces_of(scan: Scan, least_height: float) -> tuple[NDArray, int]:
    """The piece (H, W) of each reading above the support, -1 for none, and how many readings are not above it."""
    view = scan.view
    camera = camera_of(view.projection)
    pixel = 1.0 / float(view.projection.pixels_per_metre(1.0))
    pieces = np.full(view.depth.shape, -1, dtype=np.int64)
    below = _connect(
        view.depth, camera, np.array(view.T_world_sensor[2]), least_height, STEEP_PX * pixel, STEEP_SIGMAS * view.noise, pieces
    )
    return pieces, below


@njit(cache=True, nogil=True)
def _connect(depth, camera, up, least_height, steep, noise, pieces):
    """Numbers connected pieces of readings higher than `least_height`; `up` (4,) takes a point of the sensor to its height."""
    height, width = depth.shape
    parallel, below, count = camera[0] > 0.5, 0, 0
    parents = np.empty(depth.size // 2 + 1, dtype=np.int64)
    for j in range(height):
        for i in range(width):
            d = depth[j, i]
            if np.isnan(d):
                continue
            scale = 1.0 if parallel else d
            z = up[0] * (i - camera[3]) / camera[1] * scale + up[1] * (j - camera[4]) / camera[2] * scale + up[2] * d + up[3]
            if z < least_height:
                below += 1
                continue
            jump = steep * scale + noise
            left = _root(parents, pieces[j, i - 1]) if i > 0 and abs(depth[j, i - 1] - d) <= jump else -1
            above = _root(parents, pieces[j - 1, i]) if j > 0 and abs(depth[j - 1, i] - d) <= jump else -1
            if left < 0 and above < 0:
                parents[count] = count
                pieces[j, i] = count
                count += 1
            elif left < 0 or above < 0:
                pieces[j, i] = max(left, above)
            else:
                pieces[j, i] = min(left, above)
                parents[max(left, above)] = min(left, above)
    for j in range(height):
        for i in range(width):
            pieces[j, i] = _root(parents, pieces[j, i])
    return below


@njit(cache=True, nogil=True)
def _root(parents, piece):
    if piece < 0:
        return piece
    while parents[piece] != piece:
        parents[piece] = parents[parents[piece]]
        piece = parents[piece]
    return piece
