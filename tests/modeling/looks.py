"""Scans of known solids for the tests: what a camera without faults would read, by embree, noise added on request."""

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from handey_studio.geometry import Polyhedron
from handey_studio.geometry.transforms import apply, rotate, transform
from handey_studio.modeling.scans import Scan
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole

PINHOLE = Pinhole(600.0, 600.0, 159.5, 119.5)
SHAPE = (240, 320)


def looking(eye: ArrayLike, at: ArrayLike) -> NDArray:
    """T_world_sensor of a camera at `eye` that looks at a point, the image's rows level."""
    eye = np.asarray(eye, dtype=float)
    z = np.asarray(at, dtype=float) - eye
    z /= np.linalg.norm(z)
    x = np.cross(z, (0.0, 0.0, 1.0)) if abs(z[2]) < 0.999 else np.array([1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    return transform(np.c_[x, np.cross(z, x), z], eye)


def scan_of(
    solids: list[Polyhedron],
    T_world_sensor: NDArray,
    projection: Pinhole | Orthographic = PINHOLE,
    noise: float = 0.0,
    name: str = "scan",
    seed: int = 0,
    shape: tuple[int, int] = SHAPE,
) -> Scan:
    """The solids (corners in the world) on a table at z = 0, as seen from T_world_sensor; `noise` [m] along the sight."""
    meshes = [trimesh.Trimesh(solid.vertices, solid.triangles, process=False) for solid in solids]
    table = trimesh.creation.box((2.0, 2.0, 0.01), transform(translation=(0.0, 0.0, -0.005)))
    mesh = trimesh.util.concatenate([*meshes, table])
    assert isinstance(mesh, trimesh.Trimesh)
    v, u = (axis.ravel().astype(float) for axis in np.mgrid[: shape[0], : shape[1]])
    near = projection.unproject(np.stack([u, v], axis=-1), np.full(u.shape, 0.01))
    far = projection.unproject(np.stack([u, v], axis=-1), np.ones(u.shape))
    directions = (far - near) / 0.99
    hits, rays, _ = mesh.ray.intersects_location(apply(T_world_sensor, near), rotate(T_world_sensor, directions), multiple_hits=False)
    depth = np.full(u.shape, np.nan)
    depth[rays] = (hits - T_world_sensor[:3, 3]) @ T_world_sensor[:3, 2]
    depth += np.random.default_rng(seed).normal(0.0, noise, depth.shape) if noise else 0.0
    return Scan(name, DepthView(depth.reshape(shape), projection, T_world_sensor, max(noise, 0.0002), 0.001), "made by a test")


def moved(solid: Polyhedron, T: NDArray) -> Polyhedron:
    """The solid with its corners mapped by T."""
    return Polyhedron(apply(T, solid.vertices), solid.faces)
