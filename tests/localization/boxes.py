"""Boxes on a table seen by an ideal camera, ray cast in closed form: depth without noise, and where the edges truly are."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry.transforms import inverse
from handey_studio.localization.edges import edge_pixels
from handey_studio.localization.segments import DataEdge, data_edges, link
from handey_studio.localization.surface import surface_of
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole

SIGNS = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
Box = tuple[NDArray, NDArray]  # size (3,) [m], T_world_box


def box_edges(boxes: Sequence[Box]) -> NDArray:
    """Ends (n, 2, 3) of all edges in the world's frame."""
    out = []
    for size, T in boxes:
        for axis in range(3):
            for a, b in SIGNS:
                ends = np.zeros((2, 3))
                ends[:, axis] = (-0.5, 0.5)
                ends[:, (axis + 1) % 3], ends[:, (axis + 2) % 3] = 0.5 * a, 0.5 * b
                out.append((ends * size) @ T[:3, :3].T + T[:3, 3])
    return np.array(out)


def depth_of(boxes: Sequence[Box], projection: Pinhole | Orthographic, T_world_sensor: NDArray, shape: tuple[int, int]) -> NDArray:
    """Depth (H, W) [m] of boxes on the table z = 0."""
    v, u = np.mgrid[: shape[0], : shape[1]].astype(float)
    uv = np.stack([u, v], axis=-1)
    near, far = projection.unproject(uv, np.zeros(shape)), projection.unproject(uv, np.ones(shape))
    slabs = [(np.array([9.0, 9.0, 0.2]), np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -0.1], [0, 0, 0, 1]], dtype=float)), *boxes]
    depth = np.full(shape, np.inf)
    for size, T in slabs:
        T_box_sensor = inverse(T) @ T_world_sensor
        start = near @ T_box_sensor[:3, :3].T + T_box_sensor[:3, 3]
        step = (far - near) @ T_box_sensor[:3, :3].T
        with np.errstate(divide="ignore", invalid="ignore"):
            walls = np.stack([(sign * size / 2 - start) / step for sign in (-1, 1)])
        enter, leave = walls.min(axis=0).max(axis=-1), walls.max(axis=0).min(axis=-1)
        depth = np.where((enter < leave) & (enter > 0), np.minimum(depth, enter), depth)
    return np.where(np.isfinite(depth), depth, np.nan)


def edges_of(view: DepthView, shortest: float = 0.01) -> tuple[DataEdge, ...]:
    surface = surface_of(view)
    pixels = edge_pixels(view, surface)
    return data_edges(view, surface, pixels, link(view, surface, pixels), shortest)


def errors(edge: DataEdge, true_edges: NDArray) -> tuple[float, float]:
    """Distance [m] of an edge's middle from the line of the nearest true edge that passes by there, and the angle [rad] to it."""
    ends = edge.ends_world
    middle, along = ends.mean(axis=0), (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    true_along = true_edges[:, 1] - true_edges[:, 0]
    lengths = np.linalg.norm(true_along, axis=1)
    true_along = true_along / lengths[:, None]
    across = middle - true_edges[:, 0]
    s = np.einsum("ni,ni->n", across, true_along)
    distance = np.linalg.norm(across - s[:, None] * true_along, axis=1)
    angle = np.arccos(np.clip(np.abs(true_along @ along), 0, 1))
    cost = distance + 0.05 * angle + np.where((s < 0) | (s > lengths), 1.0, 0.0)
    best = int(np.argmin(cost))
    return float(distance[best]), float(angle[best])
