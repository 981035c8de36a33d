"""Extended linear segments in space: edge pixels linked while they stay on one line, then fitted in three dimensions."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.localization.dropouts import over_dropouts
from handey_studio.localization.edges import KIND_NAMES, EdgePixels
from handey_studio.localization.flanks import Seen
from handey_studio.localization.lines import Line
from handey_studio.localization.pieces import straight_lines
from handey_studio.localization.runs import MIN_PIXELS
from handey_studio.localization.surface import Surface
from handey_studio.sensing.depth_view import DepthView
from handey_studio.sensing.drawing import camera_of

MAX_TURN = np.deg2rad(30.0)  # a pixel's own direction against the segment's: pixel directions are rough
SETTLED = 12  # pixels after which the line alone decides: at corners the pixels' own directions mix


@dataclass(frozen=True, eq=False)
class DataEdge(Value):
    """A straight edge found in the depth map. `kind` is jump, convex or concave.

    `ends_sensor` and `ends_world` (2, 3) [m]. `normals_sensor` (k, 3) are those of the surfaces that meet at it and are
    seen, one at a jump, two at a crease; `inward_sensor` (k, 3) points from the edge into each of them. `rms` [m] is
    how far its pixels lie off the line; `offset_sigma` [m] and `angle_sigma` [rad] are the standard deviations of the
    line's distance, at its middle, and of its angle from those of the true edge.
    """

    kind: str
    ends_sensor: NDArray
    ends_world: NDArray
    normals_sensor: NDArray
    inward_sensor: NDArray
    pixels: int
    rms: float
    offset_sigma: float = 0.0
    angle_sigma: float = 0.0

    def __post_init__(self) -> None:
        for key in ("ends_sensor", "ends_world", "normals_sensor", "inward_sensor"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(np.linalg.norm(self.ends_sensor[1] - self.ends_sensor[0]))

    @property
    def direction(self) -> NDArray:
        """Unit direction (3,) from the first end to the second, in the sensor's frame."""
        return (self.ends_sensor[1] - self.ends_sensor[0]) / self.length


@dataclass(frozen=True, eq=False)
class Linked(Value):
    """Edge pixels (n,) as `u`, `v` [px], their `kind`, and `segment`, the number of their line among `lines`, −1 for none."""

    u: NDArray
    v: NDArray
    kind: NDArray
    segment: NDArray
    lines: tuple[Line, ...]


def link(view: DepthView, surface: Surface, edges: EdgePixels) -> Linked:
    """Edge pixels linked to straight segments, and the line in space of each."""
    v, u = np.nonzero(edges.kind)
    kind = edges.kind[v, u].astype(np.int64)
    number = np.full(view.depth.shape, -1, dtype=np.int32)
    number[v, u] = np.arange(len(u))
    across = max(1.0, 0.8 * view.outline_error / surface.pixel)  # px that a pixel may lie off its line
    ragged = across > 1.5
    gate = 6.0 * view.noise + 3.0 * surface.pixel
    depth = np.asarray(view.depth)
    theta, quality = _directions(number, u, v, kind, depth, gate, 7 if ragged else 4)
    order = np.argsort(-quality, kind="stable")
    segment = _grow(number, u, v, kind, depth, theta, order, (across, gate, MAX_TURN, 3.0 if ragged else 2.0))
    seen = Seen(depth, surface.slope, camera_of(view.projection), (view.noise, surface.typical), surface.radius_px, view.outline_error)
    lines, segment = straight_lines(seen, edges.outward, kind, u, v, segment)
    lines, segment = over_dropouts(view, seen, edges.outward, kind, u, v, lines, segment)
    return Linked(u, v, kind, segment, lines)


def data_edges(view: DepthView, surface: Surface, edges: EdgePixels, linked: Linked, min_length: float) -> tuple[DataEdge, ...]:
    """Segments of at least `min_length` [m] in space, longest first."""
    kinds = np.zeros(len(linked.lines), dtype=np.int64)
    kinds[linked.segment[linked.segment >= 0]] = linked.kind[linked.segment >= 0]
    ends = np.array([line.ends for line in linked.lines]).reshape(-1, 2, 3)
    ends_world = ends @ view.T_world_sensor[:3, :3].T + view.T_world_sensor[:3, 3]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    longest_first = [int(k) for k in np.argsort(-lengths, kind="stable") if lengths[k] >= min_length]
    return tuple(_data_edge(KIND_NAMES[kinds[k]], linked.lines[k], ends_world[k]) for k in longest_first)


def _data_edge(kind: str, line: Line, ends_world: NDArray) -> DataEdge:
    normals, inward = line.normals[: line.flanks], line.inward[: line.flanks]
    return DataEdge(kind, line.ends, ends_world, normals, inward, line.pixels, line.rms, line.offset_sigma, line.angle_sigma)


@njit(cache=True, nogil=True, error_model="numpy")
def _directions(
    number: NDArray, u: NDArray, v: NDArray, kind: NDArray, depth: NDArray, gate: float, radius: int
) -> tuple[NDArray, NDArray]:
    """Direction [rad] of each edge pixel's neighbourhood in the image, and how much it is a line: length times straightness."""
    height, width = number.shape
    theta, quality = np.zeros(len(u)), np.zeros(len(u))
    for i in range(len(u)):
        n = sx = sy = sxx = sxy = syy = 0.0
        for dv in range(-radius, radius + 1):
            for du in range(-radius, radius + 1):
                y, x = v[i] + dv, u[i] + du
                if y < 0 or x < 0 or y >= height or x >= width:
                    continue
                j = number[y, x]
                if j < 0 or kind[j] != kind[i] or abs(depth[y, x] - depth[v[i], u[i]]) > gate * (1 + max(abs(du), abs(dv))):
                    continue
                n += 1.0
                sx, sy = sx + du, sy + dv
                sxx, sxy, syy = sxx + du * du, sxy + du * dv, syy + dv * dv
        if n < 3:
            continue
        sxx, sxy, syy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
        theta[i] = 0.5 * np.arctan2(2 * sxy, sxx - syy)
        spread = np.sqrt((sxx - syy) ** 2 + 4 * sxy * sxy)
        quality[i] = spread * spread / max(sxx + syy, 1e-9)
    return theta, quality


@njit(cache=True)
def _grow(
    number: NDArray,
    u: NDArray,
    v: NDArray,
    kind: NDArray,
    depth: NDArray,
    theta: NDArray,
    order: NDArray,
    limits: tuple[float, float, float, float],
) -> NDArray:
    """Segment number (n,) of each edge pixel, −1 for none: grown from the straightest places while pixels stay on one line."""
    across, gate, max_turn, reach = limits
    r = int(reach)
    height, width = number.shape
    segment = np.full(len(u), -1)
    members = np.empty(len(u), dtype=np.int64)
    count = 0
    for seed in order:
        if segment[seed] >= 0:
            continue
        n = 1
        members[0] = seed
        segment[seed] = count
        angle = theta[seed]
        cx, cy = float(u[seed]), float(v[seed])
        sxx = sxy = syy = 0.0
        head = 0
        while head < n:
            i = members[head]
            head += 1
            for dv in range(-r, r + 1):
                for du in range(-r, r + 1):
                    y, x = v[i] + dv, u[i] + du
                    if y < 0 or x < 0 or y >= height or x >= width:
                        continue
                    j = number[y, x]
                    if j < 0 or segment[j] >= 0 or kind[j] != kind[seed]:
                        continue
                    turn = abs(theta[j] - angle) % np.pi
                    off = abs(-(x - cx) * np.sin(angle) + (y - cy) * np.cos(angle))
                    if off > across + 0.5 or (n < SETTLED and min(turn, np.pi - turn) > max_turn):
                        continue
                    if abs(depth[y, x] - depth[v[i], u[i]]) > gate * (1 + max(abs(du), abs(dv))):
                        continue
                    segment[j] = count
                    members[n] = j
                    n += 1
                    # running moments (Welford), so that the line follows its pixels
                    ex, ey = x - cx, y - cy
                    cx, cy = cx + ex / n, cy + ey / n
                    sxx, sxy, syy = sxx + ex * (x - cx), sxy + ex * (y - cy), syy + ey * (y - cy)
                    if n >= 6:
                        angle = 0.5 * np.arctan2(2 * sxy, sxx - syy)
        if n < MIN_PIXELS:
            for k in range(n):
                segment[members[k]] = -1
        else:
            count += 1
    return segment
