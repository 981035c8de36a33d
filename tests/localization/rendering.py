"""Scenes with known truth, ray cast: what an ideal sensor would read, made noisy and incomplete afterwards."""

from collections.abc import Sequence

import numpy as np
import shapely
import trimesh
from numpy.typing import NDArray

from handey_studio.geometry import Polyhedron, box
from handey_studio.geometry.transforms import apply, inverse, transform
from handey_studio.sensing.depth_map import SKY_M, DepthMap
from handey_studio.sensing.depth_view import DepthView, Pinhole

Placed = tuple[Polyhedron, NDArray]
LIGHT = np.array([0.2, 0.2, 1.2])
EYES = np.array([[-0.2, 0.2, 1.1], [0.6, 0.2, 1.1]])
T_WORLD_RANGE = transform(translation=(0.28, -0.2, 0.0))


def scene_mesh(bodies: Sequence[Placed], table: bool = True) -> trimesh.Trimesh:
    """One mesh of solids at their poses and a table top at z = 0."""
    solids = [*bodies, *([(box([4.0, 4.0, 0.02]), transform(translation=(0, 0, -0.01)))] if table else [])]
    return trimesh.util.concatenate([trimesh.Trimesh(apply(T, solid.vertices), solid.triangles, process=False) for solid, T in solids])


def first_hits(mesh: trimesh.Trimesh, origins: NDArray, directions: NDArray) -> NDArray:
    """Points (n, 3) where rays meet the mesh first, NaN where they do not."""
    points = np.full(origins.shape, np.nan)
    found, rays, _ = mesh.ray.intersects_location(origins, directions, multiple_hits=False)
    points[rays] = found
    return points


def lit(mesh: trimesh.Trimesh, points: NDArray, source: NDArray) -> NDArray:
    """Whether nothing stands between points (n, 3) and a source."""
    away = source - points
    distance = np.linalg.norm(away, axis=1)
    start = points + 1e-4 * away / distance[:, None]
    clear = np.zeros(len(points), dtype=bool)
    known = np.isfinite(points).all(axis=1)
    clear[known] = ~mesh.ray.intersects_any(start[known], away[known])
    return clear


def map_from_above(bodies: Sequence[Placed], rng: np.random.Generator, noise: float = 0.0004, dropped: float = 0.005) -> DepthMap:
    """What a range finder reads of a 0.4 × 0.4 m area: shadowed where the light or both eyes are blocked, noisy, pixels missing."""
    mesh = scene_mesh([(solid, inverse(T_WORLD_RANGE) @ T) for solid, T in bodies])
    y, x = (np.mgrid[:400, :400] + 0.5) * 0.001
    origins = np.c_[x.ravel(), y.ravel(), np.full(x.size, 1.0)]
    points = first_hits(mesh, origins, np.tile([0.0, 0.0, -1.0], (x.size, 1)))
    seen = lit(mesh, points, LIGHT) & (lit(mesh, points, EYES[0]) | lit(mesh, points, EYES[1]))
    z = points[:, 2] + rng.normal(0.0, noise, x.size)
    z[~seen | (rng.random(x.size) < dropped)] = np.nan
    return DepthMap(z.reshape(x.shape), 0.001, T_WORLD_RANGE, np.nan_to_num(z.reshape(x.shape), nan=SKY_M), noise=noise)


def oblique_view(
    bodies: Sequence[Placed], T_world_sensor: NDArray, rng: np.random.Generator, noise: float = 0.0008, dropped: float = 0.02
) -> DepthView:
    """What a depth camera of 480 × 360 px sees: the readings at jumps fall away on a ragged margin of a pixel or two."""
    pinhole = Pinhole(420.0, 420.0, 239.5, 179.5)
    mesh = scene_mesh([(solid, inverse(T_world_sensor) @ T) for solid, T in bodies], table=False)
    table = trimesh.Trimesh(apply(inverse(T_world_sensor), [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]])
    mesh = trimesh.util.concatenate([mesh, table])
    v, u = np.mgrid[:360, :480].astype(float)
    rays = pinhole.unproject(np.stack([u, v], axis=-1), np.ones(u.shape)).reshape(-1, 3)
    depth = first_hits(mesh, np.zeros_like(rays), rays)[:, 2].reshape(u.shape)
    noisy = depth + rng.normal(0.0, noise, depth.shape) * (depth / np.nanmedian(depth)) ** 2
    far = np.where(np.isfinite(depth), depth, np.inf)
    beside = np.max([np.roll(far, shift, axis) for shift, axis in ((1, 0), (-1, 0), (1, 1), (-1, 1))], axis=0)
    edge_of_surface = np.isfinite(far) & (beside - np.where(np.isfinite(far), far, 0.0) > 0.01)
    noisy[edge_of_surface & (rng.random(depth.shape) < 0.6)] = np.nan
    noisy[rng.random(depth.shape) < dropped] = np.nan
    return DepthView(noisy, pinhole, T_world_sensor, noise=noise, outline_error=0.002)


def looking_at(eye: NDArray, target: NDArray) -> NDArray:
    """T_world_sensor (4, 4) of a sensor at `eye` that looks at `target`, x to the right."""
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return transform(np.stack([x, np.cross(z, x), z], axis=1), eye)


def resting_poses(solid: Polyhedron) -> list[NDArray]:
    """Poses (4, 4) on the table z = 0, centroid above the origin, on each face of the hull that holds it stably."""
    hull = trimesh.Trimesh(solid.vertices, solid.triangles, process=False).convex_hull
    centre = solid.volume_and_centroid[1]
    poses = []
    for facet, normal in zip(hull.facets, hull.facets_normal, strict=True):
        R = trimesh.geometry.align_vectors(normal, [0, 0, -1])[:3, :3]
        corners = hull.vertices[np.unique(hull.faces[facet])] @ R.T
        foot = shapely.MultiPoint(corners[:, :2]).convex_hull
        middle = R @ centre
        if foot.contains(shapely.Point(middle[:2])) and foot.exterior.distance(shapely.Point(middle[:2])) > 0.002:
            poses.append(transform(R, (-middle[0], -middle[1], -corners[:, 2].min())))
    return poses
