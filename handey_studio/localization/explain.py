"""Explain one pose: which of its edges are found, missing or hidden, how far readings lie off it, and the pair of edges it came from.

What the screen shows of a hypothesis. It asks the same questions of the same evidence as `verify`, so that what is seen is what decided.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.geometry.transforms import apply, inverse, rotate
from handey_studio.localization.edge_pair import EdgePair, edge_pair
from handey_studio.localization.evidence import Evidence, Limits
from handey_studio.localization.pairs import model_edges
from handey_studio.localization.posed import GRAZING
from handey_studio.localization.predicted_edges import edge_states
from handey_studio.localization.result import LocateOptions
from handey_studio.localization.samples import ALONG, PartSamples, part_samples
from handey_studio.localization.search import Search, look
from handey_studio.localization.segments import DataEdge
from handey_studio.localization.verify import MIN_EDGE_SHARE, MIN_VISIBLE_SHARE, verify
from handey_studio.sensing.depth_view import DepthView
from handey_studio.sensing.drawing import rendered_depth
from handey_studio.world.part import Part

FOUND, MISSING, HIDDEN = 0, 1, 2
STATE_NAMES = ("found", "missing", "hidden")
MAX_READINGS = 12_000  # that go to the screen; of more, every few


@dataclass(frozen=True, eq=False)
class Explanation(Value):
    """What the view says to a part at one pose, in the world's frame.

    Predicted edges: `pieces_world` (n, 2, 3) [m] with the `state` (n,) of each, FOUND, MISSING where it should be seen, or HIDDEN, and its
    number `edge` (n,) in the table of model edges; `ragged_m` [m] of what is found is no edge but the surface's end, which counts
    half; `edges` (3,) are counts of whole edges by state. Readings where the part should be seen: `readings_world` (m, 3) [m] with
    their signed `distance` (m,) [m] to the model, in front of it positive; those within `limit_m` agree and leave `rms_m`, None if none.
    `surface_m2` (4,) of the faces that look at the sensor: agrees, seen through, hidden, no reading. `data_pair` and `model_pair`:
    Figure 3 of the two edges that the pose came from, None when they are not known.
    """

    pieces_world: NDArray
    state: NDArray
    edge: NDArray
    ragged_m: float
    edges: NDArray
    readings_world: NDArray
    distance: NDArray
    limit_m: float
    rms_m: float | None
    surface_m2: NDArray
    data_pair: EdgePair | None = None
    model_pair: EdgePair | None = None

    def __post_init__(self) -> None:
        for key in ("pieces_world", "readings_world", "distance", "surface_m2"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))
        for key in ("state", "edge", "edges"):
            object.__setattr__(self, key, frozen_array(getattr(self, key), np.int64))

    @property
    def lengths_m(self) -> NDArray:
        """Length (3,) [m] of edge found, missing and hidden."""
        lengths = np.linalg.norm(self.pieces_world[:, 1] - self.pieces_world[:, 0], axis=1)
        return np.bincount(self.state, lengths, 3)

    @property
    def surface_shares(self) -> NDArray:
        """Shares (4,) of the faces that look at the sensor: agrees, seen through, hidden, no reading."""
        return self.surface_m2 / max(float(self.surface_m2.sum()), 1e-12)


def explain(
    view: DepthView,
    part: Part,
    T_sensor_part: NDArray,
    data: tuple[DataEdge, ...] = (),
    model: tuple[int, ...] = (),
    search: Search | None = None,
) -> Explanation:
    """What a view says to a part at a pose (4, 4).

    `data` are the two data edges that the pose came from and `model` the numbers of the two edges in the table of model edges that
    they were taken for, empty when not known. `search` of the same view, if it is at hand, saves the looking.
    """
    search = search or look(view, LocateOptions())
    samples, evidence, limits = part_samples(part), search.evidence, search.limits
    R, t = np.ascontiguousarray(T_sensor_part[:3, :3]), np.ascontiguousarray(T_sensor_part[:3, 3])
    states = edge_states(R, t, samples, evidence, limits)
    pieces, state, edge = _pieces(samples, _shown(states))
    readings, distance = _residuals(view, part, T_sensor_part, evidence, limits)
    agree = distance[np.abs(distance) <= limits.agree]
    verdict = verify(R[None], t[None], samples, evidence, limits)
    surface = [float(area[0]) for area in (verdict.on, verdict.through, verdict.hidden, verdict.unknown)]
    T_world_part = view.T_world_sensor @ T_sensor_part
    data_pair, model_pair = _pairs(part, T_world_part, data, model)
    return Explanation(
        apply(T_world_part, pieces),
        state,
        edge,
        float(samples.edge_weight[states == 2].sum()),
        _whole_edges(samples, states),
        apply(view.T_world_sensor, readings),
        distance,
        limits.agree,
        float(np.sqrt(np.mean(agree**2))) if len(agree) else None,
        np.array(surface),
        data_pair,
        model_pair,
    )


def _shown(states: NDArray) -> NDArray:
    """FOUND, MISSING or HIDDEN of what the verifier says of samples."""
    return np.where(states >= 1, FOUND, np.where(states == 0, MISSING, HIDDEN))


def _pieces(samples: PartSamples, shown: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Runs of samples of one edge in one state, as segments (n, 2, 3) [m] in the part's frame; their states and edges (n,)."""
    begins = np.r_[True, (np.diff(samples.edge) != 0) | (np.diff(shown) != 0)]
    first = np.nonzero(begins)[0]
    last = np.r_[first[1:], len(shown)] - 1
    reach = 0.5 * samples.edge_weight[:, None] * samples.directions[samples.edge, ALONG]
    ends = np.stack([samples.edge_point[first] - reach[first], samples.edge_point[last] + reach[last]], axis=1)
    return ends, shown[first], samples.edge[first]


def _whole_edges(samples: PartSamples, states: NDArray) -> NDArray:
    """How many edges (3,) are found, missing and hidden, as the verifier counts them."""
    total = np.bincount(samples.edge)
    visible = np.bincount(samples.edge, states >= 0, len(total))
    found = np.bincount(samples.edge, states >= 1, len(total))
    predicted = (visible >= 2) & (visible >= MIN_VISIBLE_SHARE * total)
    present = predicted & (found >= MIN_EDGE_SHARE * visible)
    return np.array([present.sum(), (predicted & ~present).sum(), (~predicted).sum()])


def _residuals(view: DepthView, part: Part, T: NDArray, evidence: Evidence, limits: Limits) -> tuple[NDArray, NDArray]:
    """Readings (m, 3) [m] in the sensor's frame at pixels where the part should be seen and nothing nearer hides it, and their signed
    distances (m,) [m] to the faces that look at the sensor: the table below a part that is not there lies near none of them."""
    drawn = rendered_depth(apply(T, part.solid.vertices), part.solid.triangles, view.depth.shape, evidence.camera)
    with np.errstate(invalid="ignore"):
        v, u = np.nonzero(view.depth - drawn > -limits.hide)
    every = max(1, -(-len(u) // MAX_READINGS))
    v, u = v[::every], u[::every]
    points = view.projection.unproject(np.stack([u, v], axis=-1).astype(float), view.depth[v, u])
    away = _distances(np.ascontiguousarray(apply(inverse(T), points)), _facing(view, part, T))
    return points, np.where(view.depth[v, u] <= drawn[v, u], away, -away)


def _facing(view: DepthView, part: Part, T: NDArray) -> NDArray:
    """Triangles (k, 3, 3) [m] of the part, in its frame, that look at the sensor squarely enough to be read."""
    corners = part.solid.vertices[part.solid.triangles]
    normal = rotate(T, np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    ray = view.projection.rays(apply(T, corners.mean(axis=1)))
    return np.ascontiguousarray(corners[-np.einsum("ki,ki->k", normal, ray) >= GRAZING * np.linalg.norm(normal, axis=1)])


def _pairs(
    part: Part, T_world_part: NDArray, data: tuple[DataEdge, ...], model: tuple[int, ...]
) -> tuple[EdgePair | None, EdgePair | None]:
    """Figure 3 of the data edges and of the model edges; the missing sign of the data edges is the model's."""
    posed = None
    if len(model) == 2:
        edges, chosen = model_edges(part), np.array(model)
        reach = edges.half[chosen, None] * edges.direction[chosen]
        posed = edge_pair(apply(T_world_part, np.stack([edges.middle[chosen] - reach, edges.middle[chosen] + reach], axis=1)))
    if len(data) != 2 or min(edge.length for edge in data) <= 0.0:
        return None, posed
    ends = np.array([edge.ends_world for edge in data])
    return edge_pair(ends, None if posed is None else posed.directions), posed


@njit(cache=True)
def _distances(points, corners):
    """Distances (m,) of points (m, 3) to the nearest of triangles (k, 3, 3)."""
    out = np.full(len(points), np.inf)
    for k in range(len(corners)):
        a, e1, e2 = corners[k, 0], corners[k, 1] - corners[k, 0], corners[k, 2] - corners[k, 0]
        n = np.cross(e1, e2)
        twice = np.sqrt((n * n).sum())
        if twice < 1e-14:
            continue
        g11, g12, g22 = (e1 * e1).sum(), (e1 * e2).sum(), (e2 * e2).sum()
        for m in range(len(points)):
            x, y, z = points[m, 0] - a[0], points[m, 1] - a[1], points[m, 2] - a[2]
            p1, p2 = x * e1[0] + y * e1[1] + z * e1[2], x * e2[0] + y * e2[1] + z * e2[2]
            s, w = (g22 * p1 - g12 * p2) / twice**2, (g11 * p2 - g12 * p1) / twice**2
            if s >= 0.0 and w >= 0.0 and s + w <= 1.0:
                away = abs(x * n[0] + y * n[1] + z * n[2]) / twice
            else:
                away = min(_from_side(x, y, z, e1), _from_side(x, y, z, e2), _from_side(x - e1[0], y - e1[1], z - e1[2], e2 - e1))
            out[m] = min(out[m], away)
    return out


@njit(cache=True)
def _from_side(x, y, z, e):
    """Distance of (x, y, z) from the segment from the origin to e."""
    share = (x * e[0] + y * e[1] + z * e[2]) / (e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
    share = min(max(share, 0.0), 1.0)
    dx, dy, dz = x - share * e[0], y - share * e[1], z - share * e[2]
    return np.sqrt(dx * dx + dy * dy + dz * dz)
