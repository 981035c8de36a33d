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

from handey_studio.base import Value, frozen_array
from handey_studio.localization.shares import shared
from handey_studio.localization.surface import LEAST_ROWS, Surface, reading_sigma, unproject
from handey_studio.sensing.depth_view import DepthView
from handey_studio.sensing.drawing import camera_of

NONE, JUMP, CONVEX, CONCAVE = 0, 1, 2, 3
KIND_NAMES = ("none", "jump", "convex", "concave")
MAX_GAP_PX = 40  # a hole wider than this hides whatever comes after it
JUMP_SIGMAS = 5.0  # a jump stands out by this many sigmas of a reading
WEAK = 0.6  # share of that which a jump may sink to along an edge
CREASE_LOW, CREASE_HIGH = 0.28, 0.5  # rad; between the noise of normals and the bluntest edge that is looked for
LEAST_WAY = 2  # px on either side, without which no turn is told
CREASE_SCALE = 1000.0  # turns [rad] as Canny's whole numbers


@dataclass(frozen=True, eq=False)
class EdgePixels(Value):
    """`kind` (H, W) uint8: NONE, JUMP, CONVEX or CONCAVE. `outward` (H, W, 2) int8 points along the image's axes from a
    jump's nearer surface, whose edge it is, to the farther one."""

    kind: NDArray
    outward: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "kind", frozen_array(self.kind, np.uint8))
        object.__setattr__(self, "outward", frozen_array(self.outward, np.int8))


def edge_pixels(view: DepthView, surface: Surface) -> EdgePixels:
    """The edge pixels of a view."""
    camera, noise = camera_of(view.projection), (view.noise, surface.typical)
    depth, per_px = np.asarray(view.depth), 0.15 * surface.pixel
    strength, outward = np.zeros(depth.shape, dtype=np.float32), np.zeros((*depth.shape, 2), dtype=np.int8)
    shared(
        lambda first, last: _jumps(depth, surface.slope, surface.normals, camera, noise, per_px, (first, last), strength, outward),
        len(depth),
        LEAST_ROWS,
    )
    jump = _hysteresis(strength, WEAK * JUMP_SIGMAS, JUMP_SIGMAS)
    kind = _creases(view, surface, jump, outward)
    kind[cv2.dilate(jump, np.ones((3, 3), np.uint8)) > 0] = NONE
    kind[jump > 0] = JUMP
    for array in (kind, outward):
        array.flags.writeable = False
    return EdgePixels(kind, outward)


@njit(cache=True)
def _hysteresis(strength: NDArray, low: float, high: float) -> NDArray:
    """(H, W) uint8: pixels above `low` that are connected to one that reaches `high`."""
    height, width = strength.shape
    kept = np.zeros((height, width), dtype=np.uint8)
    stack = np.empty((height * width, 2), dtype=np.int32)
    for v in range(height):
        for u in range(width):
            if strength[v, u] < high or kept[v, u]:
                continue
            kept[v, u] = 1
            stack[0, 0], stack[0, 1] = v, u
            n = 1
            while n > 0:
                n -= 1
                j, i = stack[n]
                for y in range(max(j - 1, 0), min(j + 2, height)):
                    for x in range(max(i - 1, 0), min(i + 2, width)):
                        if not kept[y, x] and strength[y, x] > low:
                            kept[y, x] = 1
                            stack[n, 0], stack[n, 1] = y, x
                            n += 1
    return kept


@njit(cache=True)
def _beyond(depth, v, u, dv, du):
    """How many pixels on the next reading that way is: MAX_GAP_PX + 1 across a wider hole, 0 at the view's border."""
    height, width = depth.shape
    y, x = v, u
    for k in range(1, MAX_GAP_PX + 1):
        y, x = y + dv, x + du
        if y < 0 or x < 0 or y >= height or x >= width:
            return 0
        if not np.isnan(depth[y, x]):
            return k
    return MAX_GAP_PX + 1 if 0 <= y + dv < height and 0 <= x + du < width else 0


@njit(cache=True, error_model="numpy")
def _facing(u, v, d, normals, camera):
    """Cosine between the surface's normal and the way back to the sensor; 1 where there is no normal."""
    nx, ny, nz = normals[v, u, 0], normals[v, u, 1], normals[v, u, 2]
    x, y, z = unproject(u, v, d, camera)
    cosine = nz if camera[0] > 0.5 else (nx * x + ny * y + nz * z) / np.sqrt(x * x + y * y + z * z)
    return 1.0 if np.isnan(cosine) else abs(cosine)


@njit(cache=True, error_model="numpy")
def _level(depth, slope, camera, noise, v, level):
    """Tells of the pixels of row v those, nearly all, that no neighbour falls away from, without a jump even if seen squarely."""
    height, width = depth.shape
    level[:] = False
    if v == 0 or v == height - 1:
        return
    above, row, below, slopes = depth[v - 1], depth[v], depth[v + 1], slope[v]
    for u in range(1, width - 1):
        d, gu, gv = row[u], slopes[u, 0], slopes[u, 1]
        least = WEAK * JUMP_SIGMAS * reading_sigma(d, camera, noise)
        across = (row[u + 1] - d - gu <= least) & (row[u - 1] - d + gu <= least)
        level[u] = across & (below[u] - d - gv <= least) & (above[u] - d + gv <= least)


@njit(cache=True, nogil=True, error_model="numpy")
def _jumps(depth, slope, normals, camera, noise, per_px, rows, strength, outward):
    """How far the depth falls away beside each pixel of some rows, beyond its slope, in sigmas, into `strength` (H, W), and the directions
    to there into `outward` (H, W, 2).

    Holes are crossed: at a silhouette the sensor has no readings where its light or its eye is shadowed. A hole that
    is wider than MAX_GAP_PX counts as a jump that just stands out.
    """
    height, width = depth.shape
    level = np.zeros(width, dtype=np.bool_)
    for v in range(rows[0], rows[1]):
        _level(depth, slope, camera, noise, v, level)
        for u in range(width):
            d = depth[v, u]
            if level[u] or np.isnan(d):
                continue
            gu, gv = slope[v, u, 0], slope[v, u, 1]
            if np.isnan(gu):
                gu, gv = np.float32(0.0), np.float32(0.0)
            squarely, sigma = reading_sigma(d, camera, noise), 0.0
            for dv, du in ((0, 1), (0, -1), (1, 0), (-1, 0)):
                y, x = v + dv, u + du
                beside = 0 <= y < height and 0 <= x < width and not np.isnan(depth[y, x])
                k = 1 if beside else _beyond(depth, v, u, dv, du)
                if k == 0:
                    continue
                wide = k > MAX_GAP_PX
                fall = 0.0 if wide else depth[v + k * dv, u + k * du] - d - k * (gu * du + gv * dv) - per_px * (k - 1)
                if not wide and fall <= WEAK * JUMP_SIGMAS * squarely:
                    continue
                if sigma == 0.0:  # only now, as few pixels come this far
                    sigma = squarely / max(_facing(u, v, d, normals, camera), 0.2)
                fall = JUMP_SIGMAS * sigma if wide else fall
                if fall > WEAK * JUMP_SIGMAS * sigma:
                    strength[v, u] = max(strength[v, u], fall / sigma)
                    outward[v, u, 0] += du
                    outward[v, u, 1] += dv


def _creases(view: DepthView, surface: Surface, jump: NDArray, outward: NDArray) -> NDArray:
    """(H, W) uint8 NONE, CONVEX or CONCAVE: Canny's thinning and hysteresis over the turn of the normal."""
    camera, r = camera_of(view.projection), surface.radius_px
    right, down = _free_way(jump, outward, r)
    depth, slack = np.asarray(view.depth), 3.0 * view.noise
    dx, dy = np.zeros(depth.shape, dtype=np.int16), np.zeros(depth.shape, dtype=np.int16)
    bend = np.zeros(depth.shape, dtype=np.uint8)
    shared(
        lambda first, last: _turns(depth, surface.normals, camera, right, down, r, slack, (first, last), dx, dy, bend),
        len(depth),
        LEAST_ROWS,
    )
    edges = cv2.Canny(dx, dy, CREASE_SCALE * CREASE_LOW, CREASE_SCALE * CREASE_HIGH, L2gradient=True)
    return np.bitwise_and(edges, bend)  # Canny marks with all bits


@njit(cache=True)
def _free_way(jump: NDArray, outward: NDArray, r: int) -> tuple[NDArray, NDArray]:
    """How many pixels (H, W) uint8, up to r, one can go right and down before a jump: past it lies another surface."""
    height, width = jump.shape
    right, down = np.zeros((height, width), dtype=np.uint8), np.zeros((height, width), dtype=np.uint8)
    for v in range(height - 1, -1, -1):
        for u in range(width - 1, -1, -1):
            here = jump[v, u] > 0
            if u + 1 < width and not (here and outward[v, u, 0] > 0) and not (jump[v, u + 1] and outward[v, u + 1, 0] < 0):
                right[v, u] = min(r, right[v, u + 1] + 1)
            if v + 1 < height and not (here and outward[v, u, 1] > 0) and not (jump[v + 1, u] and outward[v + 1, u, 1] < 0):
                down[v, u] = min(r, down[v + 1, u] + 1)
    return right, down


@njit(cache=True, inline="always")
def _change(normals, v1, u1, v2, u2):
    """Change of the normal from one pixel to another, and its square: 0 where one has none."""
    ex = normals[v2, u2, 0] - normals[v1, u1, 0]
    ey = normals[v2, u2, 1] - normals[v1, u1, 1]
    ez = normals[v2, u2, 2] - normals[v1, u1, 2]
    squared = ex * ex + ey * ey + ez * ez
    return (ex, ey, ez, squared) if squared > 0.0 else (ex, ey, ez, np.float32(0.0))


@njit(cache=True)
def _turn(depth, normals, camera, v1, u1, v2, u2, change, slack):
    """Turn of the normal [rad] between two pixels and its sign of bending: zero unless they are on one connected surface, when
    the line between the two points lies about level under the mean normal."""
    ex, ey, ez, squared = change
    if squared == 0.0:
        return 0.0, 0.0
    x1, y1, z1 = unproject(u1, v1, depth[v1, u1], camera)
    x2, y2, z2 = unproject(u2, v2, depth[v2, u2], camera)
    x, y, z = x2 - x1, y2 - y1, z2 - z1
    a, b = normals[v1, u1], normals[v2, u2]
    size = np.sqrt(squared)
    level = abs(x * (a[0] + b[0]) + y * (a[1] + b[1]) + z * (a[2] + b[2])) / 2.0
    if level >= slack + 0.5 * size * np.sqrt(x * x + y * y + z * z):
        return 0.0, 0.0
    return 2.0 * np.arcsin(min(size / 2.0, 1.0)), ex * x + ey * y + ez * z


@njit(cache=True, nogil=True, error_model="numpy")
def _turns(depth, normals, camera, right, down, r, slack, rows, dx, dy, kind):
    """The turn of the normal over the window's width, or as far as a jump lets one go, along u and along v, into `dx` and `dy` (H, W)
    int16 for some rows, of one sign where they go the same way, and into `kind` the kind of crease that it would be."""
    width = depth.shape[1]
    least = (0.5 * CREASE_LOW) ** 2  # of the two together: flatter is no crease, nor beside one
    nothing = (np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0))
    above = np.zeros(width, dtype=np.int64)
    for v in range(max(rows[0] - r, 0), rows[1]):
        left = 0
        for u in range(width):
            left = min(r, left + 1) if u > 0 and right[v, u - 1] > 0 else 0
            above[u] = min(r, above[u] + 1) if v > 0 and down[v - 1, u] > 0 else 0
            if v < rows[0]:
                continue  # the rows before only tell how far up one can go
            after, below = int(right[v, u]), int(down[v, u])
            e = _change(normals, v, u - left, v, u + after) if min(left, after) >= LEAST_WAY else nothing
            f = _change(normals, v - above[u], u, v + below, u) if min(above[u], below) >= LEAST_WAY else nothing
            if e[3] + f[3] < least:
                continue
            turn_u, bend_u = _turn(depth, normals, camera, v, u - left, v, u + after, e, slack)
            turn_v, bend_v = _turn(depth, normals, camera, v - above[u], u, v + below, u, f, slack)
            opposite = turn_u > 0.0 and turn_v > 0.0 and e[0] * f[0] + e[1] * f[1] + e[2] * f[2] < 0.0
            dx[v, u] = int(CREASE_SCALE * turn_u)
            dy[v, u] = int(CREASE_SCALE * (-turn_v if opposite else turn_v))
            kind[v, u] = CONVEX if (bend_u if turn_u >= turn_v else bend_v) > 0.0 else CONCAVE
