"""Large depth images made smaller by a whole factor, so that later stages stay within time and memory."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.sensing.depth_view import Orthographic, Pinhole

MOST_PIXELS = 1_500_000  # a part of a pile covers thousands of pixels then; noise falls with the mean over the pixels that become one
SAME_PX = 3.0  # readings that lie within so many pixels' sizes behind the nearest of their block are its surface


def reduced(depth: NDArray, projection: Pinhole | Orthographic) -> tuple[NDArray, Pinhole | Orthographic, int]:
    """The image with k × k pixels made one, its projection, and k: 1 up to 1.5 million pixels.

    In each block the nearest surface wins, as the mean of its readings; a block without one is NaN. Rows and columns that fill no
    block are left off.
    """
    factor = int(np.ceil(np.sqrt(depth.size / MOST_PIXELS)))
    if factor <= 1 or min(depth.shape) < factor:
        return depth, projection, 1
    height, width = (size // factor for size in depth.shape)
    out = np.empty((height, width))
    rows = max(1, 200_000 // (width * factor))
    for top in range(0, height, rows):
        part = depth[top * factor : (top + rows) * factor, : width * factor][: min(rows, height - top) * factor]
        out[top : top + rows] = _nearest_mean(part, factor, projection)
    return out, _projection(projection, factor), factor


def _nearest_mean(depth: NDArray, factor: int, projection: Pinhole | Orthographic) -> NDArray:
    """One value for each factor × factor block of depth (h · factor, w · factor)."""
    height, width = (size // factor for size in depth.shape)
    blocks = depth.reshape(height, factor, width, factor).transpose(0, 2, 1, 3).reshape(height, width, factor * factor)
    known = np.isfinite(blocks)
    nearest = np.where(known, blocks, np.inf).min(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        same = SAME_PX * factor / np.asarray(projection.pixels_per_metre(nearest))
        on = known & (blocks <= (nearest + same)[..., None])
        return np.where(on, blocks, 0.0).sum(axis=-1) / on.sum(axis=-1)


def _projection(projection: Pinhole | Orthographic, factor: int) -> Pinhole | Orthographic:
    cx, cy = ((c - 0.5 * (factor - 1)) / factor for c in (projection.cx, projection.cy))
    if isinstance(projection, Pinhole):
        return Pinhole(projection.fx / factor, projection.fy / factor, cx, cy)
    return Orthographic(projection.pixel * factor, cx, cy)
