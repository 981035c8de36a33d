"""How well a solid explains a scan: every reading of the object held against it, and every ray that saw through it."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion

from handey_studio.geometry import Polyhedron
from handey_studio.geometry.transforms import apply, inverse, rotate
from handey_studio.modeling.patches.sides import lost_at_rims
from handey_studio.modeling.patches.windows import noise_image
from handey_studio.modeling.scans import Scan

ON_SIGMAS, ON_BEND_M = 4.0, 0.0025  # a reading so near lies on the solid: noise, and how cartons bulge, as far as the noise allows that
THROUGH_SIGMAS = 6.0  # a reading so far behind it has seen through it
MOST_RAYS = 20_000
MARGIN_PX = 1.0


class Fit(NamedTuple):
    """`explained`: the share of the object's readings that lie on the solid; `through`: that of the rays to it that a reading behind it
    shows to pass; `rms` [m] of the readings on it; `rays` that it would stop."""

    explained: float
    through: float
    rms: float
    rays: int


class Rays(NamedTuple):
    """Rays of one scan in the model frame, row by row of an image of `shape`: `starts` and `steps` (n, 3), one step a metre deep; `depth`
    (n,) [m] read, NaN for none, `sigma` (n,) [m]; `own` (n,) whether the reading is one of the object. Within `margin` rays of a
    silhouette a reading behind tells nothing, as sensors lose what is there."""

    shape: tuple[int, int]
    starts: NDArray
    steps: NDArray
    depth: NDArray
    sigma: NDArray
    own: NDArray
    margin: int


def rays_of(scan: Scan, T_model_scan: NDArray, own: NDArray, corners_model: NDArray) -> Rays:
    """The rays around corners (n, 3) [m], every few of them; `own` (H, W) marks the object's readings."""
    view = scan.view
    T = T_model_scan @ view.T_world_sensor
    marked = np.argwhere(own)[:, ::-1]
    uv = np.concatenate([view.projection.project(apply(inverse(T), corners_model)), marked])
    height, width = view.depth.shape
    left, top = (int(v) for v in np.clip(np.floor(np.nanmin(uv, axis=0)), 0, (width - 1, height - 1)))
    right, bottom = (int(v) + 1 for v in np.clip(np.ceil(np.nanmax(uv, axis=0)), (left, top), (width - 1, height - 1)))
    every = max(1, int(np.ceil(np.sqrt((right - left) * (bottom - top) / MOST_RAYS))))
    v, u = np.mgrid[top:bottom:every, left:right:every]
    shape, u, v = v.shape, u.ravel(), v.ravel()
    uv, depth = np.stack([u, v], axis=1).astype(float), view.depth[v, u]
    near, far = (view.projection.unproject(uv, np.full(len(uv), d)) for d in (0.0, 1.0))
    mine = own[v, u]
    scale = float(view.projection.pixels_per_metre(float(np.median(depth[mine])) if mine.any() else 1.0))
    margin = int(np.ceil((lost_at_rims(view) * scale + MARGIN_PX) / every))
    return Rays(shape, apply(T, near), rotate(T, far - near), depth, np.nan_to_num(noise_image(view)[v, u], nan=1.0), mine, margin)


def fit_of(solid: Polyhedron, views: list[Rays]) -> Fit:
    """How well the solid explains all views together."""
    corners = np.ascontiguousarray(solid.vertices[solid.triangles])
    normals = np.repeat(solid.normals, [len(solid.face_triangles(f)) for f in range(len(solid.faces))], axis=0)
    own = on = seen_through = stopped = 0
    squares = 0.0
    for rays in views:
        depth, which = first_hits(corners, rays.starts, rays.steps)
        hit = which >= 0
        cosine = np.abs(np.einsum("ni,ni->n", rays.steps, normals[which])) / np.linalg.norm(rays.steps, axis=1)
        with np.errstate(invalid="ignore"):
            behind = (rays.depth - depth) * cosine
            near = hit & rays.own & (np.abs(behind) < ON_SIGMAS * rays.sigma + np.minimum(ON_BEND_M, 1.5 * rays.sigma))
            passed = hit & (behind > THROUGH_SIGMAS * rays.sigma) & ~near
        inner = binary_erosion(hit.reshape(rays.shape), np.ones((3, 3)), max(1, rays.margin)).ravel() & np.isfinite(rays.depth)
        own, on, stopped = own + int(rays.own.sum()), on + int(near.sum()), stopped + int(inner.sum())
        seen_through += int((passed & inner).sum())
        squares += float((behind[near] ** 2).sum())
    return Fit(on / max(own, 1), seen_through / max(stopped, 1), float(np.sqrt(squares / max(on, 1))), stopped)


@njit(cache=True, error_model="numpy")
def first_hits(corners: NDArray, starts: NDArray, steps: NDArray) -> tuple[NDArray, NDArray]:
    """Where rays (n,) first meet triangles (k, 3, 3), in steps, and which triangle, -1 for none."""
    depth, which = np.full(len(starts), np.inf), np.full(len(starts), -1)
    for k in range(len(corners)):
        a = corners[k, 0]
        e, f = corners[k, 1] - a, corners[k, 2] - a
        for n in range(len(starts)):
            dx, dy, dz = steps[n, 0], steps[n, 1], steps[n, 2]
            px, py, pz = dy * f[2] - dz * f[1], dz * f[0] - dx * f[2], dx * f[1] - dy * f[0]
            det = e[0] * px + e[1] * py + e[2] * pz
            if abs(det) < 1e-15:
                continue
            sx, sy, sz = starts[n, 0] - a[0], starts[n, 1] - a[1], starts[n, 2] - a[2]
            u = (sx * px + sy * py + sz * pz) / det
            if u < 0.0 or u > 1.0:
                continue
            qx, qy, qz = sy * e[2] - sz * e[1], sz * e[0] - sx * e[2], sx * e[1] - sy * e[0]
            v = (dx * qx + dy * qy + dz * qz) / det
            if v < 0.0 or u + v > 1.0:
                continue
            t = (f[0] * qx + f[1] * qy + f[2] * qz) / det
            if 0.0 < t < depth[n]:
                depth[n], which[n] = t, k
    return depth, which
