"""The paper's depth map of what one camera saw: a grid of elevations over the table, from any view.

Handey's range finder makes its grid from stripes (1987 §3); here neighbouring readings of one surface span triangles, and the grid
takes their heights. Visibility stays the sensor's own: across a jump nothing is spanned, and what its light passed over is empty.
"""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import apply, inverse, transform
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.depth_view import DepthView, Pinhole
from handey_studio.sensing.light_paths import passing_heights

MAX_HEIGHT_M = 0.5  # readings above, or as far below, are no part of a pile
LEAST_CELL_M, MOST_CELL_M = 0.0005, 0.02
MOST_CELLS = 1024  # a side, when the cell is not given
MAX_SIDE = 4096
STEEP_PX, STEEP_SIGMAS = 4.0, 6.0  # neighbouring readings that differ in depth by more pixels' sizes and deviations are two surfaces
OUTER_SHARE = 0.002  # of the readings on each side do not widen the grid
FAR_M = 10.0  # up a parallel view's light


def depth_map_of(
    view: DepthView,
    cell: float | None = None,
    low: ArrayLike | None = None,
    high: ArrayLike | None = None,
    max_height: float = MAX_HEIGHT_M,
) -> DepthMap:
    """The depth map of a view whose world has the table at z = 0 and z up.

    The grid reaches from `low` to `high`, (x, y) [m] of the world, else over all readings within `max_height` [m] of the table, in
    cells of side `cell` [m], else about a pixel's size. The highest surface wins; cells without one stay NaN. `passed` is what the
    light from the readings to the sensor tells. Raises BadInput for a view without readings there, or for a grid that is too large.
    """
    points = apply(view.T_world_sensor, view.points_sensor())
    points[~(np.abs(points[..., 2]) <= max_height)] = np.nan
    readings = points[np.isfinite(points[..., 2])]
    if len(readings) < 3:
        raise BadInput(f"the view has {len(readings)} readings within {max_height:g} m of the table; a depth map takes 3.")
    corner, far = _extent(readings, low, high)
    pixel = float(1.0 / view.projection.pixels_per_metre(float(np.nanmedian(view.depth))))
    side = _cell_of(pixel, float((far - corner).max())) if cell is None else cell
    nx, ny = (max(1, int(np.ceil(length / side - 1e-6))) for length in far - corner)
    if not LEAST_CELL_M / 5 <= side <= MOST_CELL_M or max(nx, ny) > MAX_SIDE:
        raise BadInput(
            f"a depth map of {nx} × {ny} cells of {side:g} m is not usable; it takes up to {MAX_SIDE} a side, of 0.0001 to 0.02 m."
        )
    T_world_range = transform(translation=(corner[0], corner[1], 0.0))
    local = points - T_world_range[:3, 3]
    elevation = np.full((ny, nx), -np.inf)
    _span(elevation, side, local, np.array(view.depth), STEEP_PX * pixel + STEEP_SIGMAS * view.noise)
    _add_single(elevation, side, local)
    elevation[np.isinf(elevation)] = np.nan
    starts = local[np.isfinite(local[..., 2])]
    passed = passing_heights(elevation, side, starts, _eyes(view, T_world_range, starts))
    return DepthMap(elevation, side, T_world_range, passed, view.noise, max(view.outline_error, side))


def _extent(readings: NDArray, low: ArrayLike | None, high: ArrayLike | None) -> tuple[NDArray, NDArray]:
    """The grid's corners (x, y) [m]."""
    seen = np.quantile(readings[:, :2], [OUTER_SHARE, 1.0 - OUTER_SHARE], axis=0)
    corner = seen[0] if low is None else np.asarray(low, dtype=float)
    far = seen[1] if high is None else np.asarray(high, dtype=float)
    if corner.shape != (2,) or far.shape != (2,) or not (far > corner).all():
        raise BadInput(f"a depth map from {np.round(corner, 4).tolist()} to {np.round(far, 4).tolist()} m has no area.")
    return corner, far


def _cell_of(pixel: float, length: float) -> float:
    """About a pixel's size, in whole tenths of a millimetre, and so that the grid has at most `MOST_CELLS` a side."""
    return float(np.clip(np.ceil(1e4 * max(pixel, length / MOST_CELLS) - 1e-6) * 1e-4, LEAST_CELL_M, MOST_CELL_M))


def _eyes(view: DepthView, T_world_range: NDArray, points: NDArray) -> NDArray:
    """Where the light of each reading (n, 3) went, in the range frame."""
    T_range_sensor = inverse(T_world_range) @ view.T_world_sensor
    if isinstance(view.projection, Pinhole):
        return np.broadcast_to(T_range_sensor[:3, 3], points.shape)
    return points - FAR_M * T_range_sensor[:3, 2]


@njit(cache=True)
def _span(elevation: NDArray, cell: float, points: NDArray, depth: NDArray, jump: float) -> None:
    """Raise each cell to the highest triangle over its centre; triangles join neighbouring readings (H, W, 3) without a jump."""
    height, width = depth.shape
    for v in range(height - 1):
        for u in range(width - 1):
            for half in range(2):
                v0, u0 = (v, u) if half == 0 else (v + 1, u + 1)
                a, b, c = points[v0, u0], points[v + 1, u], points[v, u + 1]
                if np.isnan(a[2]) or np.isnan(b[2]) or np.isnan(c[2]):
                    continue
                da, db, dc = depth[v0, u0], depth[v + 1, u], depth[v, u + 1]
                if max(da, db, dc) - min(da, db, dc) > jump:
                    continue
                _raise_triangle(elevation, cell, a, b, c)


@njit(cache=True)
def _raise_triangle(elevation: NDArray, cell: float, a: NDArray, b: NDArray, c: NDArray) -> None:
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if abs(area) < 1e-14:
        return
    ny, nx = elevation.shape
    i0, i1 = int(np.floor(min(a[0], b[0], c[0]) / cell)), int(np.floor(max(a[0], b[0], c[0]) / cell))
    j0, j1 = int(np.floor(min(a[1], b[1], c[1]) / cell)), int(np.floor(max(a[1], b[1], c[1]) / cell))
    for j in range(max(0, j0), min(ny - 1, j1) + 1):
        for i in range(max(0, i0), min(nx - 1, i1) + 1):
            x, y = (i + 0.5) * cell, (j + 0.5) * cell
            s = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
            t = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
            if s >= -1e-6 and t >= -1e-6 and s + t <= 1.0 + 2e-6:
                elevation[j, i] = max(elevation[j, i], a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2]))


def _add_single(elevation: NDArray, cell: float, points: NDArray) -> None:
    """The highest reading in cells that no triangle covers: readings alone, and the last ones before a jump."""
    flat = points[np.isfinite(points[..., 2])]
    i, j = (np.floor(flat[:, k] / cell).astype(int) for k in (0, 1))
    inside = (i >= 0) & (j >= 0) & (i < elevation.shape[1]) & (j < elevation.shape[0])
    i, j, z = i[inside], j[inside], flat[inside, 2]
    empty = np.isinf(elevation[j, i])
    np.maximum.at(elevation, (j[empty], i[empty]), z[empty])
