"""What the view offers to a verifier: readings, the nearest edge pixel of each direction."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.localization.segments import Linked
from handey_studio.localization.shares import shared
from handey_studio.localization.surface import Surface
from handey_studio.sensing.depth_view import DepthView, Pinhole
from handey_studio.sensing.drawing import project

DIRECTIONS = 6  # sectors of edge directions in the image
SECTOR = np.pi / DIRECTIONS
ROUGH = 1.8  # tolerances of poses straight from two edges, against those of refined ones
MOST_REACH_PX = 100  # of an edge pixel
U, V, X, Y, Z, KIND = range(6)  # columns of edge pixels
TAN_15 = float(np.tan(SECTOR / 2))


class Limits(NamedTuple):
    """Tolerances of verification [m]: a reading within `agree` of the face lies on it, one nearer than `hide` hides it, one
    farther than `through` shows that nothing is there; an edge within `edge` sideways and `edge_depth` in depth is found, at a
    silhouette no more than `outside` beyond it."""

    agree: float
    hide: float
    through: float
    edge: float
    edge_depth: float
    outside: float


class Evidence(NamedTuple):
    """Arrays that the compiled verifier reads.

    `depth` (H, W) [m]; `nearest` (DIRECTIONS, H, W) number of the nearest edge pixel whose direction is about that of the sector, −1 for
    none; `edges` (n, 6) of edge pixels: U, V [px], the point X, Y, Z [m], and the KIND, JUMP, CONVEX or CONCAVE. `camera`: 1 if
    parallel, scale x, scale y, cx, cy, as in `project`; `pixel` [m]. Inner loops take the arrays one by one: compiled code
    that takes them out of a tuple each time spends most of its time counting references to them.
    """

    depth: NDArray
    nearest: NDArray
    edges: NDArray
    camera: tuple[float, float, float, float, float]
    pixel: float


def limits_of(view: DepthView, slack: float = 1.0) -> Limits:
    """Tolerances from the view's noise and outline error; `slack` > 1 for poses that were not refined yet."""
    agree = slack * (4.0 * view.noise + 0.5 * view.outline_error)
    edge = slack * (view.outline_error + view.noise)
    outside = edge if slack > 1.0 else 0.4 * view.outline_error + view.noise
    return Limits(agree, 1.2 * agree, 1.5 * agree, edge, 2.0 * agree + view.outline_error, outside)


def evidence_of(view: DepthView, surface: Surface, linked: Linked) -> Evidence:
    """The evidence of a view; only edge pixels that belong to a straight segment, and have a reading, count."""
    members = np.nonzero((linked.segment >= 0) & np.isfinite(view.depth[linked.v, linked.u]))[0]
    u, v = linked.u[members], linked.v[members]
    theta = _segment_directions(linked)[linked.segment[members]]
    p = view.projection
    pinhole = isinstance(p, Pinhole)
    camera = (0.0, p.fx, p.fy, p.cx, p.cy) if pinhole else (1.0, 1.0 / p.pixel, 1.0 / p.pixel, p.cx, p.cy)
    uv = np.stack([u, v], axis=1).astype(float)
    points = view.projection.unproject(uv, view.depth[v, u])
    edges = np.column_stack([uv, points, linked.kind[members]])
    return Evidence(np.array(view.depth), _nearest(view, edges, theta, surface.pixel), edges, camera, surface.pixel)


def _nearest(view: DepthView, edges: NDArray, theta: NDArray, pixel: float) -> NDArray:
    """(DIRECTIONS, H, W) int32: which of the edge pixels (n, 6) with directions `theta` (n,) [rad] is nearest, −1 where none is as near as
    a rough pose's edge may lie."""
    rough = limits_of(view, ROUGH)
    nearest_z = np.maximum(edges[:, Z] - rough.edge_depth, 0.5 * edges[:, Z])
    reach = np.ceil((rough.edge + 0.7 * pixel) * view.projection.pixels_per_metre(nearest_z)).astype(np.int64)
    out = np.full((DIRECTIONS, *view.depth.shape), -1, dtype=np.int32)
    shared(lambda first, last: _spread(edges, theta, np.minimum(reach, MOST_REACH_PX), (first, last), out), DIRECTIONS)
    return out


@njit(cache=True, nogil=True)
def _spread(edges, theta, reach, sectors, nearest):
    """Writes the number of each edge pixel of some sectors to all pixels within its reach [px] of which none is nearer; of two
    as near that of the nearer surface counts."""
    height, width = nearest.shape[1:]
    for sector in range(sectors[0], sectors[1]):
        away = np.full((height, width), 2 * MOST_REACH_PX**2, dtype=np.int32)
        for k in range(len(edges)):
            if abs((theta[k] - sector * SECTOR + np.pi / 2) % np.pi - np.pi / 2) > SECTOR:
                continue
            u, v, r = int(edges[k, U]), int(edges[k, V]), reach[k]
            for y in range(max(v - r, 0), min(v + r + 1, height)):
                rest = r * r - (y - v) * (y - v)
                for x in range(max(u - r, 0), min(u + r + 1, width)):
                    squared = (x - u) * (x - u) + (y - v) * (y - v)
                    if (x - u) * (x - u) > rest or squared > away[y, x]:
                        continue
                    if squared < away[y, x] or edges[k, Z] < edges[nearest[sector, y, x], Z]:
                        away[y, x], nearest[sector, y, x] = squared, k


def _segment_directions(linked: Linked) -> NDArray:
    """Direction [rad] of each segment in the image, modulo π."""
    member = linked.segment >= 0
    segment, u, v = linked.segment[member], linked.u[member].astype(float), linked.v[member].astype(float)
    n = np.maximum(np.bincount(segment), 1)
    mean_u, mean_v = np.bincount(segment, u) / n, np.bincount(segment, v) / n
    du, dv = u - mean_u[segment], v - mean_v[segment]
    return 0.5 * np.arctan2(2 * np.bincount(segment, du * dv), np.bincount(segment, du * du) - np.bincount(segment, dv * dv))


@njit(cache=True, error_model="numpy", inline="always")
def pixels_per_metre(z, camera):
    """How many pixels a metre across the view covers at depth z [m]."""
    return camera[1] if camera[0] > 0.5 else camera[1] / z


@njit(cache=True, error_model="numpy", inline="always")
def ray_at(x, y, z, camera):
    """Unit direction of the sensor's look at a point."""
    if camera[0] > 0.5:
        return 0.0, 0.0, 1.0
    near = 1.0 / np.sqrt(x * x + y * y + z * z)
    return x * near, y * near, z * near


@njit(cache=True, error_model="numpy", inline="always")
def sector_of(du, dv):
    """Number of the sector that a direction in the image lies in, either way along it."""
    if dv < 0.0:
        du, dv = -du, -dv
    flat = abs(du)
    sector = 0 if dv < TAN_15 * flat else 1 if dv < flat else 2 if TAN_15 * dv < flat else 3
    return DIRECTIONS - sector if du < 0.0 and sector > 0 else sector


@njit(cache=True, error_model="numpy", inline="always")
def in_image(x, y, z, dx, dy, dz, camera):
    """How the image of a point moves [px/m] when the point moves along (dx, dy, dz)."""
    if camera[0] > 0.5:
        return dx * camera[1], dy * camera[2]
    near = 1.0 / z
    return (dx - x * near * dz) * near * camera[1], (dy - y * near * dz) * near * camera[2]


@njit(cache=True, error_model="numpy")
def nearest_edge(x, y, z, du, dv, nearest, edges, camera):
    """Number of the nearest edge pixel of about the direction (du, dv) in the image at a point, −1 for none, and its distance [m]
    sideways."""
    u, v = project(x, y, z, camera)
    i, j = int(np.rint(u)), int(np.rint(v))
    if i < 0 or j < 0 or i >= nearest.shape[2] or j >= nearest.shape[1]:
        return -1, np.inf
    k = nearest[sector_of(du, dv), j, i]
    if k < 0:
        return -1, np.inf
    off_u, off_v = edges[k, U] - u, edges[k, V] - v
    return k, np.sqrt(off_u * off_u + off_v * off_v) / pixels_per_metre(z, camera)
