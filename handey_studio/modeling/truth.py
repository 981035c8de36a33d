"""The truth about a model: how far each reading lies from it, how much of it was seen, and what was seen through it."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron
from handey_studio.geometry.distances import Surface, signed_distances, surface_of
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.modeling.checks import solid_checks
from handey_studio.modeling.doubts import doubts
from handey_studio.modeling.object_readings import Readings, object_readings
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.truth_values import ScanTruth, Truth
from handey_studio.sensing.depth_view import DepthView, Orthographic
from handey_studio.sensing.drawing import camera_of, draw, window
from handey_studio.sensing.facets import sigma_at

MOST_SHOWN = 2000  # points that show where readings deny the model


@dataclass(frozen=True)
class TruthOptions:
    """`sigmas` of its noise, up to which a reading counts as explained. A reading `least_height_m` above the support may be the object's;
    pieces that come within `reach_m` of the model are, and `rms` is of the readings within it. A spot of the surface is seen if a
    reading there lies within `seen_m` (or `sigmas` noises) of it. A line of sight denies the model if it passes deeper inside than
    the view's outline error and `sigmas` noises. `samples` spots of the surface are looked at."""

    sigmas: float = 3.0
    least_height_m: float = 0.0015
    reach_m: float = 0.008
    seen_m: float = 0.003
    samples: int = 3000


def truth(
    solid: Polyhedron,
    scans: tuple[Scan, ...],
    Ts_model_scan: tuple[NDArray, ...],
    options: TruthOptions = TruthOptions(),
    masks: tuple[NDArray | None, ...] | None = None,
    density: float = 700.0,
) -> Truth:
    """A solid in the model frame against all scans; `masks[k]` (H, W) may tell which readings of scan k are the object's.

    Raises BadInput when scans, poses and masks are not equally many.
    """
    masks = (None,) * len(scans) if masks is None else masks
    if not len(scans) == len(Ts_model_scan) == len(masks):
        raise BadInput(f"there are {len(scans)} scans, {len(Ts_model_scan)} poses and {len(masks)} masks; they must be equally many.")
    surface, (spots, spot_faces, areas) = surface_of(solid), surface_spots(solid, options.samples)
    seen, told = np.zeros(len(spots), dtype=bool), []
    for scan, T, mask in zip(scans, Ts_model_scan, masks, strict=True):
        readings = object_readings(scan, T, surface, solid.vertices, options.reach_m, options.least_height_m, mask)
        through = _seen_through(scan.view, T, solid, surface, options)
        told.append(_scan_truth(scan, readings, through, options))
        seen |= _seen(scan.view, T, readings, spots, solid.normals, spot_faces, options)
    faces_seen = np.bincount(spot_faces, weights=seen, minlength=len(areas)) / np.bincount(spot_faces, minlength=len(areas))
    distances = np.concatenate([each.distances for each in told]) if told else np.empty(0)
    explained = sum(each.explained * len(each.distances) for each in told) / max(1, len(distances))
    checks = solid_checks(solid, density)
    seen_share = float(faces_seen @ areas / areas.sum())
    return Truth(tuple(told), _rms(distances, options.reach_m), explained, seen_share, faces_seen, checks, doubts(told, explained))


def surface_spots(solid: Polyhedron, count: int) -> tuple[NDArray, NDArray, NDArray]:
    """About `count` spots (n, 3) [m] in even grids on all faces, at least one on each, the face of each (n,), and the faces' areas (m,)."""
    frames = [solid.face_frame(f) for f in range(len(solid.faces))]
    polygons = [solid.face_polygon(f, T) for f, T in enumerate(frames)]
    areas = np.array([polygon.area for polygon in polygons])
    step = float(np.sqrt(areas.sum() / count))
    spots = []
    for T, polygon in zip(frames, polygons, strict=True):
        x0, y0, x1, y1 = polygon.bounds
        x, y = (axis.ravel() for axis in np.meshgrid(np.arange(x0 + step / 2, x1, step), np.arange(y0 + step / 2, y1, step)))
        inside = shapely.contains_xy(polygon, x, y)
        middle = shapely.get_coordinates(polygon.representative_point())
        flat = np.stack([x[inside], y[inside]], axis=-1) if inside.any() else middle
        spots.append(flat @ T[:3, :2].T + T[:3, 3])
    return np.concatenate(spots), np.repeat(np.arange(len(spots)), [len(some) for some in spots]), areas


def _scan_truth(scan: Scan, readings: Readings, through: tuple[float, float, NDArray], options: TruthOptions) -> ScanTruth:
    on = np.abs(readings.distances) <= options.sigmas * readings.sigmas
    return ScanTruth(
        scan.name,
        readings.points,
        readings.distances,
        readings.faces,
        scan.view.noise,
        readings.left_out,
        _rms(readings.distances, options.reach_m),
        float(on.mean()) if len(on) else 0.0,
        *through,
    )


def _rms(distances: NDArray, reach: float) -> float:
    near = distances[np.abs(distances) <= reach]
    return float(np.sqrt((near**2).mean())) if len(near) else float("nan")


def _seen(
    view: DepthView, T_model_scan: NDArray, readings: Readings, spots: NDArray, normals: NDArray, spot_faces: NDArray, options: TruthOptions
) -> NDArray:
    """Which spots (n, 3) a reading lies on: one whose nearest face is theirs, in their pixel or beside it."""
    height, width = view.depth.shape
    face_at = np.full((height + 2, width + 2), -1, dtype=np.int32)  # a margin of one pixel all around
    on = np.abs(readings.distances) <= np.maximum(options.seen_m, options.sigmas * readings.sigmas)
    face_at[readings.pixels[on, 0] + 1, readings.pixels[on, 1] + 1] = readings.faces[on]
    T_sensor_model = inverse(T_model_scan @ view.T_world_sensor)
    local = apply(T_sensor_model, spots)
    facing = (view.projection.rays(local) * (normals @ T_sensor_model[:3, :3].T)[spot_faces]).sum(axis=1) < 0.0
    pixels = np.rint(np.nan_to_num(view.projection.project(local), nan=-1.0, posinf=-1.0, neginf=-1.0))
    inside = facing & (pixels >= 0).all(axis=1) & (pixels < (width, height)).all(axis=1)
    if not isinstance(view.projection, Orthographic):
        inside &= local[:, 2] > 0.0
    u, v = pixels[inside].astype(int).T
    found = np.zeros(len(spots), dtype=bool)
    found[inside] = np.logical_or.reduce([face_at[v + j, u + i] == spot_faces[inside] for j in range(3) for i in range(3)])
    return found


def _seen_through(
    view: DepthView, T_model_scan: NDArray, solid: Polyhedron, surface: Surface, options: TruthOptions
) -> tuple[float, float, NDArray]:
    """The share of the model's image where the light passed through it, how deep inside [m], and where on its surface (k, 3).

    The light that ended at a reading went through all space before it: half way between where it would have entered the model and
    where it would have left it, or ended, it was so deep inside.
    """
    T_model_sensor = T_model_scan @ view.T_world_sensor
    corners = apply(inverse(T_model_sensor), solid.vertices)
    entry, leaving, (u0, v0) = _entry_and_exit(view, corners, solid.triangles)
    depth = view.depth[v0 : v0 + entry.shape[0], u0 : u0 + entry.shape[1]]
    drawn = np.isfinite(entry) & np.isfinite(depth)
    v, u = np.nonzero(drawn & (np.nan_to_num(depth) > np.nan_to_num(entry)))
    first, last, end = entry[v, u], leaving[v, u], depth[v, u]
    limit = options.sigmas * sigma_at(view, end)
    passed = end - first > limit
    v, u, first, limit = v[passed], u[passed], first[passed], limit[passed]
    last = np.fmin(last[passed], end[passed])
    uv = np.stack([u + u0, v + v0], axis=-1).astype(float)
    halfway = apply(T_model_sensor, view.projection.unproject(uv, (first + last) / 2.0))
    inside = -signed_distances(surface, halfway)[0]
    denied = inside > np.maximum(view.outline_error, limit)
    if not denied.any():
        return 0.0, 0.0, np.empty((0, 3))
    some = np.nonzero(denied)[0][:: max(1, int(denied.sum()) // MOST_SHOWN)]
    shown = apply(T_model_sensor, view.projection.unproject(uv[some], first[some]))
    return float(denied.sum() / drawn.sum()), float(inside[denied].max()), shown


def _entry_and_exit(view: DepthView, corners: NDArray, triangles: NDArray) -> tuple[NDArray, NDArray, tuple[int, int]]:
    """Depths (h, w) [m] at which the light enters the solid and first leaves it, NaN beside it, and the window's first pixel (u, v)."""
    camera = camera_of(view.projection)
    u0, v0, u1, v1 = window(corners, camera, view.depth.shape)
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    away = (np.cross(b - a, c - a) * view.projection.rays((a + b + c) / 3.0)).sum(axis=1) > 0.0
    depths = []
    for some in (triangles, triangles[away]):
        out, drawn = np.full((v1 - v0, u1 - u0), np.nan), np.full((v1 - v0, u1 - u0), -1, dtype=np.int32)
        draw(np.ascontiguousarray(corners), np.ascontiguousarray(some), np.arange(len(some)), camera, u0, v0, out, drawn)
        depths.append(out)
    return depths[0], depths[1], (u0, v0)
