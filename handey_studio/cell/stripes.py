"""What the range finder's cameras see: the peaks of the laser's stripes on the true bodies.

Each camera's pixels are traced to the first surface they meet, and each such point to the laser. Along an image row the
angle of the laser plane that would light a pixel changes steadily over a face; where it passes the angle of a real plane
between two lit pixels of one face, there is that plane's peak. The stripe's width and inter-reflections are left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from handey_studio.cell.bodies import SolidBody
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.stripes.range_finder import RangeFinder, fuse, triangulate

GRAZING = 0.2  # least cosine between a ray and the surface's normal that still gives a peak: steeper than 78° is lost
LIT_M = 2e-4  # a shadow ray that ends this close to the point has reached it; above the ray caster's single precision
MAX_PLANES_A_PIXEL = 8  # more between neighbouring pixels means a surface seen edge-on, whose peaks melt together


@dataclass(frozen=True)
class Peaks:
    """Peaks (n,) of one camera's photographs: column u [px], row v [px], and the laser plane's number."""

    u: NDArray
    v: NDArray
    plane: NDArray


@dataclass(frozen=True)
class Hits:
    """First surfaces along rays (n,): the point (n, 3) [m], its face (n,), -1 for none, and the cosine of incidence (n,)."""

    points: NDArray
    face: NDArray
    cosine: NDArray


class Surfaces:
    """The true faces in the range frame, ready for ray casting. Not a value: it lives as long as one scan."""

    def __init__(self, bodies: Sequence[SolidBody], T_range_world: NDArray) -> None:
        corners: list[NDArray] = []
        sizes: list[int] = []
        for body in bodies:
            points = body.corners_world @ T_range_world[:3, :3].T + T_range_world[:3, 3]
            for f in range(len(body.solid.faces)):
                corners.append(points[body.solid.face_triangles(f)])
                sizes.append(len(corners[-1]))
        self.triangles = np.concatenate(corners)
        self.face = np.repeat(np.arange(len(sizes)), sizes)
        normals = np.cross(self.triangles[:, 1] - self.triangles[:, 0], self.triangles[:, 2] - self.triangles[:, 0])
        self.normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        self.offsets = np.einsum("ij,ij->i", self.normals, self.triangles[:, 0])
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, self.triangles.astype(np.float32))

    def first(self, origin: NDArray, directions: NDArray) -> Hits:
        """The first surfaces along rays from one point (3,) in unit directions (n, 3); the caster picks, the plane gives the point."""
        origins = np.broadcast_to(origin, directions.shape).astype(np.float32)
        triangle = self._scene.run(origins, directions.astype(np.float32))
        normals = self.normals[triangle]
        cosine = -np.einsum("ij,ij->i", normals, directions)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (normals @ origin - self.offsets[triangle]) / cosine
        hit = (triangle >= 0) & (cosine > 0)
        points = origin + directions * np.where(hit, distance, np.nan)[:, None]
        return Hits(points, np.where(hit, self.face[triangle], -1), cosine)


def stripe_peaks(finder: RangeFinder, camera: int, surfaces: Surfaces) -> Peaks:
    """All peaks in one camera's photographs, without noise."""
    view = finder.cameras[camera]
    columns, rows = _window(finder, camera, float(surfaces.triangles[..., 2].max()))
    v, u = np.stack(np.meshgrid(rows, columns, indexing="ij")).reshape(2, -1)
    rays = view.projection.unproject(np.stack([u, v], axis=-1).astype(float), np.ones(u.size))
    rays = (rays / np.linalg.norm(rays, axis=1, keepdims=True)) @ view.T_range_camera[:3, :3].T
    seen = surfaces.first(view.T_range_camera[:3, 3], rays)
    lit = (seen.face >= 0) & (seen.cosine >= GRAZING)
    lit[lit] = _lit(finder, surfaces, seen.points[lit])
    offset = seen.points - finder.laser
    angle = np.arctan2(offset[:, 0], -offset[:, 2])
    number = (angle + finder.sweep_rad) / (2 * finder.sweep_rad) * (finder.planes - 1)
    grid = (len(rows), len(columns))
    peaks = _crossings(number.reshape(grid), np.where(lit, seen.face, -1).reshape(grid), finder.planes)
    return Peaks(peaks.u + columns[0], peaks.v + rows[0], peaks.plane)


def _window(finder: RangeFinder, camera: int, top: float) -> tuple[NDArray, NDArray]:
    """The columns and rows of the photographs that can show the scan area, from the table's level up to `top` [m]."""
    view = finder.cameras[camera]
    x, y = finder.area
    corners = np.array([[i, j, k] for i in (0.0, x) for j in (0.0, y) for k in (min(0.0, top), max(0.0, top))])
    uv = view.projection.project(apply(inverse(view.T_range_camera), corners))
    low, high = np.floor(uv.min(axis=0)).astype(int) - 2, np.ceil(uv.max(axis=0)).astype(int) + 3
    columns = np.arange(max(0, low[0]), max(2, min(view.width, high[0])))
    return columns, np.arange(max(0, low[1]), max(2, min(view.height, high[1])))


def _lit(finder: RangeFinder, surfaces: Surfaces, points: NDArray) -> NDArray:
    """Which points (n, 3) the laser reaches at an angle that still gives a peak."""
    beams = points - finder.laser
    reach = np.linalg.norm(beams, axis=1)
    first = surfaces.first(finder.laser, beams / reach[:, None])
    with np.errstate(invalid="ignore"):
        return (np.linalg.norm(first.points - points, axis=1) < LIT_M) & (first.cosine >= GRAZING)


def _crossings(number: NDArray, face: NDArray, planes: int) -> Peaks:
    """Where whole plane numbers lie between neighbours of a row that show one face; `face` is -1 where unlit."""
    a, b = number[:, :-1], number[:, 1:]
    with np.errstate(invalid="ignore"):
        same = (face[:, :-1] >= 0) & (face[:, :-1] == face[:, 1:]) & (np.abs(a - b) <= MAX_PLANES_A_PIXEL)
    v, u = np.nonzero(same)
    a, b = a[v, u], b[v, u]
    first = np.floor(np.minimum(a, b)).astype(int) + 1
    count = np.floor(np.maximum(a, b)).astype(int) - first + 1
    pixel = np.repeat(np.arange(len(v)), count)
    plane = first[pixel] + np.arange(len(pixel)) - np.repeat(np.cumsum(count) - count, count)
    share = (plane - a[pixel]) / (b[pixel] - a[pixel])
    swept = (plane >= 0) & (plane < planes)
    return Peaks((u[pixel] + share)[swept], v[pixel][swept].astype(float), plane[swept])


def photograph(finder: RangeFinder, bodies: Sequence[SolidBody], rng: np.random.Generator) -> DepthMap:
    """One scan of the true bodies: peaks in every camera with noise, triangulated and fused."""
    surfaces = Surfaces(bodies, inverse(finder.T_world_range))
    readings = []
    for camera in range(len(finder.cameras)):
        peaks = stripe_peaks(finder, camera, surfaces)
        u = peaks.u + rng.normal(0.0, finder.peak_noise_px, len(peaks.u))
        readings.append(triangulate(finder, camera, u, peaks.v, peaks.plane))
    cameras = np.repeat(np.arange(len(readings)), [len(points) for points in readings])
    return fuse(finder, np.concatenate(readings), cameras)
