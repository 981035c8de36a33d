"""Picking: what a click meets first, scan or model, and the nearest feature that it snaps to.

A surface is met as it is seen: readings span it, the solid covers it. Then the features around the click are asked in the order of the
options: corners, edges and planes of the model and of the patches. A feature that its own line of sight does not reach is hidden.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value
from handey_studio.geometry import Polyhedron
from handey_studio.geometry.transforms import apply, inverse, rotate
from handey_studio.modeling.patches.patch import SUPPORT, Patches
from handey_studio.modeling.picking.features import Features, corners_of, edges_of
from handey_studio.modeling.picking.sightlines import meets_readings
from handey_studio.modeling.picking.snap import MODEL, Ray, Snap, SnapOptions
from handey_studio.modeling.scans import Scan

GRAZING = 0.1  # a plane that the ray meets at a smaller sine: the reading is projected straight onto it


@dataclass(frozen=True, eq=False)
class Pickable(Value):
    """All that a click can meet, prepared once for a state of the model. `patches[k]` may be None; all in the model frame."""

    scans: tuple[Scan, ...]
    Ts_sensor_model: tuple[NDArray, ...]
    patches: tuple[Patches | None, ...]
    planes: tuple[NDArray, ...]
    solid: Polyhedron | None
    corners: Features
    edges: Features


@dataclass(frozen=True)
class _Hit:
    distance: float
    point: NDArray
    normal: NDArray  # towards the eye, or zeros
    owner: int
    number: int


def pickable(
    scans: tuple[Scan, ...],
    Ts_model_scan: tuple[NDArray, ...],
    patches: tuple[Patches | None, ...],
    solid: Polyhedron | None = None,
) -> Pickable:
    """Everything that can be clicked, from scans with their poses and patches (None: not segmented yet), and the solid if there is one."""
    Ts = tuple(np.asarray(T, dtype=float) for T in Ts_model_scan)
    planes = tuple(_planes(T, found) for T, found in zip(Ts, patches, strict=True))
    corners, edges = corners_of(scans, Ts, patches, solid), edges_of(scans, Ts, patches, solid)
    Ts_sensor_model = tuple(inverse(T @ scan.view.T_world_sensor) for scan, T in zip(scans, Ts, strict=True))
    return Pickable(scans, Ts_sensor_model, patches, planes, solid, corners, edges)


def pick(scene: Pickable, ray: Ray, options: SnapOptions = SnapOptions()) -> Snap | None:
    """What a click snaps to; None where it meets nothing and no feature is near."""
    hit = _first_hit(scene, ray, options)
    for kind in options.kinds:
        if kind == "vertex":
            snap = _feature(scene, ray, options, "vertex", scene.corners, options.vertex_px)
        elif kind == "edge":
            snap = _feature(scene, ray, options, "edge", scene.edges, options.edge_px)
        else:
            snap = _plane(scene, hit)
        if snap is not None:
            return snap
    return _surface(scene, hit)


def _plane(scene: Pickable, hit: _Hit | None) -> Snap | None:
    if hit is None or hit.number == -1:
        return None
    if hit.owner == MODEL:
        of = f"face {hit.number} of the model"
    else:
        of = "the support" if hit.number == SUPPORT else f"patch {hit.number}"
        of += f' in scan "{scene.scans[hit.owner].name}"'
    return Snap("plane", hit.point, np.zeros(3), hit.normal, hit.owner, hit.number, of, 0.0)


def _surface(scene: Pickable, hit: _Hit | None) -> Snap | None:
    if hit is None:
        return None
    of = "the model's surface" if hit.owner == MODEL else f'a reading of scan "{scene.scans[hit.owner].name}"'
    return Snap("point", hit.point, np.zeros(3), hit.normal, hit.owner, hit.number if hit.owner == MODEL else -1, of, 0.0)


def _feature(scene: Pickable, ray: Ray, options: SnapOptions, kind: str, features: Features, reach_px: float) -> Snap | None:
    """The nearest feature within reach that is not hidden; the model's own count as a little nearer than a patch's."""
    usable = _usable(features.owners, options)
    if not usable.any():
        return None
    points, away = features.nearest(ray)
    weighed = np.where(usable & (away <= reach_px), away - options.model_px * (features.owners == MODEL), np.inf)
    for k in np.argsort(weighed, kind="stable"):
        if not np.isfinite(weighed[k]):
            return None
        if not _hidden(scene, ray, points[k], options):
            owner, number = int(features.owners[k]), int(features.numbers[k])
            return Snap(kind, points[k], features.directions[k], np.zeros(3), owner, number, features.words[k], float(away[k]))
    return None


def _usable(owners: NDArray, options: SnapOptions) -> NDArray:
    of_model = owners == MODEL
    of_scans = ~of_model if options.scans is None else np.isin(owners, options.scans)
    return (of_model & options.to_model) | (of_scans & ~of_model)


def _hidden(scene: Pickable, ray: Ray, point: NDArray, options: SnapOptions) -> bool:
    way = point - ray.origin
    first = _first_hit(scene, Ray(ray.origin, way, ray.pixel_rad), options)
    return first is not None and _behind(first, float(np.linalg.norm(way)), point, options)


def _behind(front: _Hit, distance: float, point: NDArray, options: SnapOptions) -> bool:
    """Whether a point at a distance along the line of sight lies clearly behind what that line meets first."""
    if distance - front.distance <= options.hidden_m:
        return False
    return not front.normal.any() or bool((front.point - point) @ front.normal > options.hidden_m)


def _first_hit(scene: Pickable, ray: Ray, options: SnapOptions) -> _Hit | None:
    """The model where it is not clearly behind the readings, else the nearest surface of readings."""
    among = range(len(scene.scans)) if options.scans is None else options.scans
    seen = [hit for k in among if (hit := _scan_hit(scene, k, ray)) is not None]
    nearest = min(seen, key=lambda hit: hit.distance, default=None)
    model = _model_hit(scene.solid, ray) if options.to_model and scene.solid is not None else None
    if model is None or (nearest is not None and _behind(nearest, model.distance, model.point, options)):
        return nearest
    return model


def _scan_hit(scene: Pickable, k: int, ray: Ray) -> _Hit | None:
    """What the ray meets of a scan: the patch that the reading there belongs to, the support, or the reading alone."""
    T = scene.Ts_sensor_model[k]
    met = meets_readings(scene.scans[k].view, apply(T, ray.origin), rotate(T, ray.direction))
    if met is None:
        return None
    distance, row, column = met
    point, patches = ray.origin + distance * ray.direction, scene.patches[k]
    number = -1 if patches is None else int(patches.labels[row, column])
    if number == -1:
        return _Hit(distance, point, np.zeros(3), k, -1)
    normal, offset = scene.planes[k][number, :3], float(scene.planes[k][number, 3])
    off, sine = float(normal @ point - offset), float(normal @ ray.direction)
    if abs(sine) > GRAZING:
        distance = distance - off / sine
        return _Hit(distance, ray.origin + distance * ray.direction, normal, k, number)
    return _Hit(distance, point - off * normal, normal, k, number)


def _model_hit(solid: Polyhedron, ray: Ray) -> _Hit | None:
    """The first face that the ray meets from outside."""
    corners = solid.vertices[solid.triangles]
    along, across = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(along, across)
    facing = normal @ ray.direction
    entering = facing < -1e-9 * np.linalg.norm(normal, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        to_start = ray.origin - corners[:, 0]
        turned = np.cross(to_start, ray.direction)
        s, t = -(across * turned).sum(axis=1) / facing, (along * turned).sum(axis=1) / facing
        distance = -(normal * to_start).sum(axis=1) / facing
        inside = entering & (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1.0 + 1e-9) & (distance > 0.0)
    if not inside.any():
        return None
    first = int(np.argmin(np.where(inside, distance, np.inf)))
    face = int(solid.face_of_triangle[first])
    return _Hit(float(distance[first]), ray.origin + distance[first] * ray.direction, solid.normals[face], MODEL, face)


def _planes(T_model_scan: NDArray, found: Patches | None) -> NDArray:
    """Normal and offset (n + 2, 4) of a scan's patches in the model frame; the last but one row, number -2, is the support."""
    numbers = 0 if found is None else max((patch.number for patch in found.patches), default=-1) + 1
    planes = np.zeros((numbers + 2, 4))
    planes[SUPPORT, 2] = 1.0
    for patch in found.patches if found is not None else ():
        planes[patch.number] = (*patch.normal, patch.offset)
    normals = rotate(T_model_scan, planes[:, :3])
    return np.c_[normals, planes[:, 3] + normals @ T_model_scan[:3, 3]]
