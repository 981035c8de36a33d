"""A list of points becomes a depth image: seen from the sensor if the points look like that, else from straight above their support."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handey_studio.geometry.transforms import apply, inverse, transform
from handey_studio.sensing.depth_view import Orthographic, Pinhole
from handey_studio.sensing.reading.raster import MAX_SIDE, Raster, raster_of

MAX_POINTS = 3_000_000  # more are thinned to as many, taken at random: a view has half as many pixels at the most
MAX_TAN = 1.5  # half the widest field of view, as a tangent
MAX_BEHIND = 0.03  # of the cells that hold two surfaces; more, and the points were not seen from there
MAX_EMPTIER = 0.01  # a viewpoint's image has no more holes than the view from above by this share: what a sensor sees hides nothing else
STEP_CELLS = 6.0  # readings of one cell that differ by more cells are two surfaces
SAME_CELLS = 2.0  # readings of one cell that differ by less are one, and are averaged
PINHOLE_NEIGHBOURS = 5  # of eight, that lie on one surface, fill an empty cell
NEIGHBOURS = tuple((dv, du) for dv in (-1, 0, 1) for du in (-1, 0, 1) if (dv, du) != (0, 0))
MIN_PLANE_SHARE = 0.1
TRIALS, SAMPLES = 500, 3000
PLANE_WIDTH = 0.004  # of the cloud's size: a reading this near to a plane lies on it
CROSSING_COST = 3.0  # points on both sides of a plane speak against its being a support, each as loudly as three on it
ROOM_M = 0.5  # the parallel view's origin is so far above the highest point
UPRIGHT_RAD = 0.03  # a support that leans less off the cloud's own z is taken for level, as in a map of elevations


class Gridded(NamedTuple):
    """Depth (H, W) [m], NaN where no reading, how its pixels look, and where the view stands in the cloud's frame (4, 4)."""

    depth: NDArray
    projection: Pinhole | Orthographic
    T_cloud_sensor: NDArray


def grid_points(points: NDArray, viewpoints: list[NDArray], rng: np.random.Generator) -> Gridded | None:
    """The view of finite points (n, 3) [m] in any frame; `viewpoints` (4, 4) are where a sensor may have stood, likeliest first.

    A viewpoint serves if the points lie on the raster of its image, or fill it without holes, one surface to each pixel. Else the view
    is parallel, from above the plane with the most points on it, upper being the side where the others are. None if there is neither.
    """
    if len(points) > MAX_POINTS:
        points = points[rng.integers(len(points), size=MAX_POINTS)]
    points = points.astype(float)
    seen: list[Gridded] = []
    for T_cloud_sensor in viewpoints:
        for T in (T_cloud_sensor, _turned_to(points, T_cloud_sensor[:3, 3])):
            found, on_raster = _seen_from(points, T)
            if found is not None and on_raster:
                return found
            seen += [] if found is None else [found]
    above = _from_above(points, rng)
    holes = 1.0 if above is None else _holes(above.depth)
    return next((found for found in seen if _holes(found.depth) <= holes + MAX_EMPTIER), above)


def into_camera(points: NDArray, pinhole: Pinhole, shape: tuple[int, int] | None) -> NDArray:
    """Depth (H, W) [m] of points (n, 3) [m] of the sensor's frame in a known camera; without `shape` as far as the points go."""
    points = points[points[:, 2] > 0].astype(float)
    uv = np.rint(pinhole.project(points))
    if shape is None:
        largest = uv[(np.abs(uv) < MAX_SIDE).all(axis=1)].max(axis=0, initial=0.0).astype(int)
        shape = (int(largest[1]) + 1, int(largest[0]) + 1)
    step = STEP_CELLS * float(np.median(points[:, 2])) / pinhole.fx if len(points) else 1.0
    return without_pinholes(nearest_surface(uv, points[:, 2], shape, step)[0], step)


def nearest_surface(uv: NDArray, z: NDArray, shape: tuple[int, int], step: float) -> tuple[NDArray, float]:
    """Depth (H, W) [m] where points fall at (u, v) (n, 2) [px] with depths (n,) [m], and the share of cells that hold two surfaces.

    In each cell the nearest surface wins, as the mean of its readings; others lie more than `step` [m] behind. NaN in empty cells.
    """
    cells = np.rint(uv)
    inside = ((cells >= 0) & (cells < shape[::-1])).all(axis=1)
    number = (cells[inside, 1] * shape[1] + cells[inside, 0]).astype(np.int64)
    z = z[inside]
    size = shape[0] * shape[1]
    near = np.full(size, np.inf)
    np.minimum.at(near, number, z)
    behind = z - near[number]
    mixed = np.zeros(size, dtype=bool)
    mixed[number[behind > step]] = True
    on = behind <= step * SAME_CELLS / STEP_CELLS
    count = np.bincount(number[on], minlength=size)
    with np.errstate(invalid="ignore", divide="ignore"):
        depth = np.bincount(number[on], weights=z[on], minlength=size) / count
    return depth.reshape(shape), float(mixed.sum() / max(1, np.count_nonzero(count)))


def without_pinholes(depth: NDArray, tolerance: float) -> NDArray:
    """Empty cells among neighbours that lie within `tolerance` [m] of each other, filled with their median; wider holes stay."""
    padded = np.pad(depth, 1, constant_values=np.nan)
    filled = depth.copy()
    empty = np.isnan(depth)
    known = ndimage.uniform_filter((~empty).astype(np.float32), 3, mode="constant") * 9.0
    v, u = np.nonzero(empty & (np.asarray(known) > PINHOLE_NEIGHBOURS - 0.5))
    if len(v):
        around = np.stack([padded[1 + v + dv, 1 + u + du] for dv, du in NEIGHBOURS], axis=1)
        flat = np.nanmax(around, axis=1) - np.nanmin(around, axis=1) <= tolerance
        filled[v[flat], u[flat]] = np.nanmedian(around[flat], axis=1)
    return filled


def _holes(depth: NDArray) -> float:
    """The share of cells without a reading among those that readings surround."""
    known = np.isfinite(depth)
    span = np.asarray(ndimage.binary_fill_holes(ndimage.binary_closing(np.pad(known, 8), iterations=3)))[8:-8, 8:-8]
    return 1.0 - float(known.sum()) / max(1, int((span | known).sum()))


def _seen_from(points: NDArray, T_cloud_sensor: NDArray) -> tuple[Gridded | None, bool]:
    """The pinhole's image from a viewpoint, None if the points do not look like seen from there; whether they lie on its raster."""
    local = apply(inverse(T_cloud_sensor), points)
    local = local[local[:, 2] > 0]
    if len(local) < 0.99 * len(points):
        return None, False
    directions = local[:, :2] / local[:, 2:]
    if np.abs(np.quantile(directions, [0.01, 0.99], axis=0)).max() > MAX_TAN:
        return None, False
    raster = raster_of(directions)
    step = STEP_CELLS * raster.pitch[0] * float(np.median(local[:, 2]))
    depth, behind = nearest_surface(raster.pixels(directions), local[:, 2], raster.shape, step)
    if behind > MAX_BEHIND:
        return None, False
    pinhole = Pinhole(
        1.0 / raster.pitch[0], 1.0 / raster.pitch[1], -raster.origin[0] / raster.pitch[0], -raster.origin[1] / raster.pitch[1]
    )
    return Gridded(without_pinholes(depth, step), pinhole, T_cloud_sensor), raster.regular


def _turned_to(points: NDArray, eye: NDArray) -> NDArray:
    """T_cloud_sensor (4, 4) at `eye`, looking at the points."""
    away = points - eye
    z = np.median(away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-12), axis=0)
    z = z / max(float(np.linalg.norm(z)), 1e-12) if np.linalg.norm(z) > 1e-6 else np.array([0.0, 0.0, 1.0])
    return transform(_axes(z).T, eye)


def _axes(z: NDArray) -> NDArray:
    """Rows x, y, z of a right-handed frame, x as near the cloud's x as it can be."""
    x = np.array([1.0, 0.0, 0.0]) - z[0] * z if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0]) - z[1] * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def _from_above(points: NDArray, rng: np.random.Generator) -> Gridded | None:
    """The parallel view from above the support, None if the points show none."""
    normal = _support_normal(points, rng)
    if normal is None:
        return None
    if normal[2] > np.cos(UPRIGHT_RAD):
        normal = np.array([0.0, 0.0, 1.0])
    R = _axes(-normal)
    low, high = np.quantile(points @ normal, [0.0, 0.9995])
    T_cloud_sensor = transform(R.T, normal * (high + ROOM_M))
    local = apply(inverse(T_cloud_sensor), points[points @ normal <= high + 0.2 * (high - low)])
    raster = raster_of(local[:, :2])
    pixel = float(np.mean(raster.pitch)) if np.isclose(*raster.pitch, rtol=1e-4) else min(raster.pitch)
    raster = Raster.over(local[:, :2], pixel, raster.origin)  # square pixels: a parallel view has no others
    depth, _ = nearest_surface(raster.pixels(local[:, :2]), local[:, 2], raster.shape, STEP_CELLS * pixel)
    projection = Orthographic(pixel, -raster.origin[0] / pixel, -raster.origin[1] / pixel)
    return Gridded(without_pinholes(depth, STEP_CELLS * pixel), projection, T_cloud_sensor)


def _support_normal(points: NDArray, rng: np.random.Generator) -> NDArray | None:
    """The unit normal (3,) of the plane with the most points on it and all others on one side, towards those; None without one."""
    some = points[rng.integers(len(points), size=min(SAMPLES, len(points)))]
    width = PLANE_WIDTH * float(np.linalg.norm(np.subtract(*np.quantile(some, [0.95, 0.05], axis=0))))
    a, b, c = (some[rng.integers(len(some), size=TRIALS)] for _ in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    usable = lengths > 1e-12
    if width <= 0 or not usable.any():
        return None
    normals = normals[usable] / lengths[usable, None]
    heights = some @ normals.T - np.einsum("ij,ij->i", normals, a[usable])
    above, below = (heights > 2 * width).sum(axis=0), (heights < -2 * width).sum(axis=0)
    votes = (np.abs(heights) < width).sum(axis=0) - CROSSING_COST * np.minimum(above, below)
    best = int(np.argmax(votes))
    normal, offset = normals[best], float(normals[best] @ a[usable][best])
    for _ in range(4):
        on = some[np.abs(some @ normal - offset) < width]
        if len(on) < MIN_PLANE_SHARE * len(some):
            return None
        normal = np.linalg.svd(on - on.mean(axis=0), full_matrices=False)[2][2]
        offset = float(normal @ on.mean(axis=0))
    height = some @ normal - offset
    up, down = (height > 2 * width).sum(), (height < -2 * width).sum()
    towards_origin = offset < 0  # nothing stands on it: the side of the cloud's own origin
    return normal if up > down or (up == down and towards_origin) else -normal
