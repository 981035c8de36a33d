"""Edges in the depth map (Handey 1987 §3): pixels where the depth jumps or the surface creases.

The paper runs Canny's operator over elevations taken as brightness. Here its steps, thinning across the edge and
hysteresis along it, run over two quantities that mean something in space: by how much the depth jumps beyond what the
surface's slope explains, and by how much the normal turns. Jump edges lie on the nearer surface, where the part is.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from handey_studio.base import Value, frozen_array
from handey_studio.localization.surface import Surface
from handey_studio.sensing.depth_view import DepthView, Pinhole

NONE, JUMP, CONVEX, CONCAVE = 0, 1, 2, 3
KIND_NAMES = ("none", "jump", "convex", "concave")
MAX_GAP_PX = 40  # a hole wider than this hides whatever comes after it
JUMP_SIGMAS = 5.0  # a jump stands out by this many sigmas of a reading
CREASE_LOW, CREASE_HIGH = 0.28, 0.5  # rad; between the noise of normals and the bluntest edge that is looked for


@dataclass(frozen=True, eq=False)
class EdgePixels(Value):
    """`kind` (H, W) uint8: NONE, JUMP, CONVEX or CONCAVE. `outward` (H, W, 2) [px] points from a jump's nearer surface
    to the farther one, zero elsewhere."""

    kind: NDArray
    outward: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "kind", frozen_array(self.kind, np.uint8))
        object.__setattr__(self, "outward", frozen_array(self.outward))


def edge_pixels(view: DepthView, surface: Surface) -> EdgePixels:
    """The edge pixels of a view."""
    rays = view.projection.rays(surface.points)
    facing = np.abs(np.einsum("...i,...i->...", surface.normals, rays))
    sigma = view.noise * _noise_growth(view) / np.where(np.isfinite(facing), np.maximum(facing, 0.2), 1.0)
    strength, outward = _jumps(view.depth, surface.slope, sigma, 0.15 * surface.pixel, MAX_GAP_PX)
    jump = _hysteresis(strength > 0.6 * JUMP_SIGMAS, strength > JUMP_SIGMAS)
    crease = _creases(surface, view.noise)
    near_jump = cv2.dilate(jump.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    kind = np.where(near_jump, NONE, crease)
    kind[jump] = JUMP
    kind[np.isnan(view.depth)] = NONE  # an edge pixel is a point in space
    return EdgePixels(kind, np.where(jump[..., None], outward, 0.0))


def _noise_growth(view: DepthView) -> NDArray:
    """How much noisier each reading is than the view's typical one: triangulated depth degrades with its square."""
    if isinstance(view.projection, Pinhole) and np.isfinite(view.depth).any():
        return np.maximum((view.depth / np.nanmedian(view.depth)) ** 2, 0.5)
    return np.ones(view.depth.shape)


def _hysteresis(weak: NDArray, strong: NDArray) -> NDArray:
    """Connected weak pixels that hold a strong one."""
    labels = np.zeros(weak.shape, dtype=np.int32)
    ndimage.label(weak, structure=np.ones((3, 3)), output=labels)
    keep = np.zeros(int(labels.max()) + 1, dtype=bool)
    keep[np.unique(labels[strong & weak])] = True
    keep[0] = False
    return keep[labels]


@njit(cache=True)
def _jumps(depth: NDArray, slope: NDArray, sigma: NDArray, per_px: float, max_gap: int) -> tuple[NDArray, NDArray]:
    """How far the depth falls away beside each pixel, beyond its slope, in sigmas (H, W), and the directions to there.

    Holes are crossed: at a silhouette the sensor has no readings where its light or its eye is shadowed. A hole that
    is wider than `max_gap` counts as a jump that just stands out.
    """
    height, width = depth.shape
    strength = np.zeros((height, width))
    outward = np.zeros((height, width, 2))
    for v in range(height):
        for u in range(width):
            if np.isnan(depth[v, u]):
                continue
            gu, gv = slope[v, u, 0], slope[v, u, 1]
            if np.isnan(gu):
                gu = gv = 0.0
            for dv, du in ((0, 1), (0, -1), (1, 0), (-1, 0)):
                k = 1
                while k <= max_gap and 0 <= v + k * dv < height and 0 <= u + k * du < width and np.isnan(depth[v + k * dv, u + k * du]):
                    k += 1
                if not (0 <= v + k * dv < height and 0 <= u + k * du < width):
                    continue
                if k > max_gap:
                    fall = JUMP_SIGMAS * sigma[v, u]
                else:
                    fall = depth[v + k * dv, u + k * du] - depth[v, u] - k * (gu * du + gv * dv) - per_px * (k - 1)
                if fall > 0.6 * JUMP_SIGMAS * sigma[v, u]:
                    strength[v, u] = max(strength[v, u], fall / sigma[v, u])
                    outward[v, u, 0] += du
                    outward[v, u, 1] += dv
    return strength, outward


def _creases(surface: Surface, noise: float) -> NDArray:
    """(H, W) NONE, CONVEX or CONCAVE: Canny's thinning and hysteresis over the turn of the normal."""
    turn_u, bend_u, normal_u = _turn(surface, 1, noise)
    turn_v, bend_v, normal_v = _turn(surface, 0, noise)
    same_way = np.sign(np.einsum("...i,...i->...", normal_u, normal_v))
    scale = 1000.0
    dx = np.clip(scale * turn_u, 0, 32000).astype(np.int16)
    dy = np.clip(scale * turn_v * np.where(same_way == 0, 1, same_way), -32000, 32000).astype(np.int16)
    edges = cv2.Canny(dx, dy, scale * CREASE_LOW, scale * CREASE_HIGH, L2gradient=True) > 0
    bend = np.where(turn_u >= turn_v, bend_u, bend_v)
    return np.where(edges, np.where(bend > 0, CONVEX, CONCAVE), NONE)


def _turn(surface: Surface, axis: int, noise: float) -> tuple[NDArray, NDArray, NDArray]:
    """Turn of the normal [rad] along one image axis, over the window's width; its sign of bending; and the change itself.

    Only within one connected surface: the line between the two points must lie about level under the mean normal.
    """
    r = surface.radius_px
    shape = surface.normals.shape
    change = np.zeros(shape)
    turn, bend = np.zeros(shape[:2]), np.zeros(shape[:2])
    low, high, mid = (np.s_[: -2 * r], np.s_[2 * r :], np.s_[r:-r])
    a, b, c = ((k,) if axis == 0 else (slice(None), k) for k in (low, high, mid))
    n_a, n_b = surface.normals[a], surface.normals[b]
    across = surface.points[b] - surface.points[a]
    delta = n_b - n_a
    size = np.linalg.norm(delta, axis=-1)
    reach = np.linalg.norm(across, axis=-1)
    level = np.abs(np.einsum("...i,...i->...", across, n_a + n_b)) / 2.0 < 3.0 * noise + 0.5 * size * reach
    usable = level & np.isfinite(size)
    turn[c] = np.where(usable, 2.0 * np.arcsin(np.clip(size / 2.0, 0, 1)), 0.0)
    bend[c] = np.where(usable, np.einsum("...i,...i->...", delta, across), 0.0)
    change[c] = np.where(usable[..., None], delta, 0.0)
    return turn, bend, change
