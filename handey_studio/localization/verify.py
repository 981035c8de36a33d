"""Verify: does the view show what the part would show if it stood there (Handey 1987 §3)?

The paper counts the predicted edges that are present. Counting those that are visible and missing as well is what
tells a small box from its outline laid inside a bigger face. Edges behind a nearer surface say nothing.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.localization.edges import CONVEX
from handey_studio.localization.evidence import Evidence, Limits, nearest_edge, pixels_per_metre, project, ray_at
from handey_studio.localization.samples import PartSamples

ON, HIDDEN, THROUGH, UNKNOWN = 0, 1, 2, 3
GRAZING = 0.12  # cosine; a face seen more edge-on than this gives no readings to count on
MIN_OF_ONE = 4  # samples of a face before their mean counts
STEEP = 0.4  # cosine; a face seen more squarely than this should give readings
UNREAD_COST = 0.3  # of a reading that sees through: no reading where there should be one
ENDS_WORTH = 0.5  # of a found edge: the surface ends within the tolerance, but raggedly
CREASE_DISCOUNT = 0.5  # of a missing edge, if it is a crease
GLANCE = 50  # points of all faces that the first look takes
MAX_THROUGH = 0.3
MIN_VISIBLE_SHARE = 0.2  # of an edge's samples that must be visible for the edge to be predicted
MIN_EDGE_SHARE = 0.5  # of an edge's visible samples that must be found for the edge to count as found


class Verdict(NamedTuple):
    """What speaks for and against poses (n,).

    `found` and `missing` [m] of visible edge; of the faces that look at the sensor [m²] those `on` readings, seen `through`,
    `hidden` behind nearer readings, and `unknown` where nothing was read; the number of edges `predicted` to be seen and of those
    found, `edges`; how far found edge pixels `scatter` [m] about a common margin; `unbent` [m] of the missing edges between two faces
    that are both seen, as creases are harder to find than outlines; and by how much [m] the face
    that lies worst is `lifted` against what is seen.
    """

    found: NDArray
    missing: NDArray
    on: NDArray
    through: NDArray
    hidden: NDArray
    unknown: NDArray
    predicted: NDArray
    edges: NDArray
    scatter: NDArray
    unbent: NDArray
    lifted: NDArray

    def rows(self, chosen: NDArray) -> "Verdict":
        """Those of some of the poses, by their numbers."""
        return Verdict(*(array[chosen] for array in self))

    @property
    def edge_share(self) -> NDArray:
        """Share of the visible edges that was found."""
        return self.found / np.maximum(self.found + self.missing, 1e-9)

    @property
    def surface_share(self) -> NDArray:
        """Share of the faces that are not hidden where the readings agree."""
        return self.on / np.maximum(self.on + self.through + UNREAD_COST * self.unknown, 1e-12)

    @property
    def visible_fraction(self) -> NDArray:
        """Share of the faces looking at the sensor that is seen."""
        return self.on / np.maximum(self.on + self.through + self.hidden + self.unknown, 1e-12)

    @property
    def support(self) -> NDArray:
        """Rank [m]: found less missing edge, less what is seen through, as a length, times the shares that are right."""
        balance = self.found - self.missing + CREASE_DISCOUNT * self.unbent - 2.0 * np.sqrt(self.through)
        return balance * np.where(balance > 0, self.edge_share * self.surface_share**2, 1.0)


def verify(R: NDArray, t: NDArray, samples: PartSamples, evidence: Evidence, limits: Limits, every: int = 1) -> Verdict:
    """Verdicts on the poses R (n, 3, 3), t (n, 3) of the part in the sensor's frame, from every `every`-th sample."""
    counts = _verify(np.ascontiguousarray(R), np.ascontiguousarray(t), samples, evidence, limits, every)
    lengths_and_areas = (0, 1, 2, 3, 4, 5, 9)
    counts[:, lengths_and_areas] *= every
    return Verdict(*counts.T)


def unopposed(R: NDArray, t: NDArray, samples: PartSamples, evidence: Evidence, limits: Limits) -> NDArray:
    """Numbers of the poses R (n, 3, 3), t (n, 3) that a glance does not rule out: the sensor sees through less than `MAX_THROUGH` of
    the few points of the faces that it looks at."""
    return np.nonzero(_unopposed(np.ascontiguousarray(R), np.ascontiguousarray(t), samples, evidence, limits))[0]


@njit(cache=True)
def reading_at(x, y, z, evidence, limits):
    """How the reading at a point's pixel stands to it (ON, HIDDEN, THROUGH, UNKNOWN), and how far behind it [m]."""
    u, v = project(x, y, z, evidence.camera)
    i, j = int(np.rint(u)), int(np.rint(v))
    if z <= 0.0 or i < 0 or j < 0 or i >= evidence.depth.shape[1] or j >= evidence.depth.shape[0]:
        return UNKNOWN, 0.0
    behind = evidence.depth[j, i] - z
    if np.isnan(behind):
        return UNKNOWN, 0.0
    if behind < -limits.hide:
        return HIDDEN, behind
    return (THROUGH if behind > limits.through else ON), behind


@njit(cache=True)
def _dot(R, r, w):
    return R[r, 0] * w[0] + R[r, 1] * w[1] + R[r, 2] * w[2]


@njit(cache=True)
def facing(R, normal, x, y, z, camera):
    """Cosine between a face's outward normal and the way back to the sensor, at a point of it."""
    rx, ry, rz = ray_at(x, y, z, camera)
    return -(_dot(R, 0, normal) * rx + _dot(R, 1, normal) * ry + _dot(R, 2, normal) * rz)


@njit(cache=True)
def edge_state(R, t, k, samples, evidence, limits):
    """One edge sample at a pose: 1 found, 2 no edge pixel but the surface ends there, 0 visible but missing, −1 not to be seen.
    Then the edge pixel that was found, or −1."""
    p = samples.edge_point[k]
    x, y, z = _dot(R, 0, p) + t[0], _dot(R, 1, p) + t[1], _dot(R, 2, p) + t[2]
    inset = limits.edge + evidence.pixel
    state, flanks = -1, 0
    ix = iy = iz = 0.0
    for flank in range(2):
        normal = samples.left[k] if flank == 0 else samples.right[k]
        if facing(R, normal, x, y, z, evidence.camera) < GRAZING:
            continue
        into = samples.into_left[k] if flank == 0 else samples.into_right[k]
        ix, iy, iz = _dot(R, 0, into), _dot(R, 1, into), _dot(R, 2, into)
        flanks += 1
        seen = reading_at(x + inset * ix, y + inset * iy, z + inset * iz, evidence, limits)[0]
        if seen in (ON, THROUGH):
            state = 0
    if state < 0:
        return -1, -1
    a = samples.along[k]
    edge, sideways = nearest_edge(x, y, z, _dot(R, 0, a), _dot(R, 1, a), _dot(R, 2, a), evidence)
    close = edge >= 0 and sideways <= limits.edge + 0.7 * evidence.pixel and abs(evidence.edge_point[edge, 2] - z) <= limits.edge_depth
    if flanks == 2:
        return (1, edge) if close else (0, -1)
    # a silhouette: sensors lose readings there, they do not add any, and a surface that bends away in sight is none
    if close and evidence.edge_kind[edge] != CONVEX and inwards(R, t, k, edge, samples, evidence) >= -limits.outside - 0.7 * evidence.pixel:
        return 1, edge
    beyond = limits.outside + evidence.pixel
    seen = reading_at(x - beyond * ix, y - beyond * iy, z - beyond * iz, evidence, limits)[0]
    if seen == HIDDEN:
        return (2 if samples.concave[k] else -1), -1  # at a concave edge the part's own wall rises
    return (0 if seen == ON else 2), -1


@njit(cache=True)
def crease_in_sight(R, t, k, samples, evidence):
    """Whether both faces beside an edge sample look at the sensor."""
    p = samples.edge_point[k]
    x, y, z = _dot(R, 0, p) + t[0], _dot(R, 1, p) + t[1], _dot(R, 2, p) + t[2]
    left, right = samples.left[k], samples.right[k]
    return facing(R, left, x, y, z, evidence.camera) >= GRAZING and facing(R, right, x, y, z, evidence.camera) >= GRAZING


@njit(cache=True)
def inwards(R, t, k, edge, samples, evidence):
    """How far [m] an edge pixel lies from an edge sample across the edge in the image, positive towards the face that is seen."""
    p, a = samples.edge_point[k], samples.along[k]
    x, y, z = _dot(R, 0, p) + t[0], _dot(R, 1, p) + t[1], _dot(R, 2, p) + t[2]
    into = samples.into_left[k] if facing(R, samples.left[k], x, y, z, evidence.camera) >= GRAZING else samples.into_right[k]
    step = evidence.pixel
    u, v = project(x, y, z, evidence.camera)
    ua, va = project(x + step * _dot(R, 0, a), y + step * _dot(R, 1, a), z + step * _dot(R, 2, a), evidence.camera)
    ui, vi = project(x + step * _dot(R, 0, into), y + step * _dot(R, 1, into), z + step * _dot(R, 2, into), evidence.camera)
    nu, nv = va - v, u - ua
    length = np.sqrt(nu * nu + nv * nv) + 1e-12
    side = 1.0 if nu * (ui - u) + nv * (vi - v) > 0 else -1.0
    off = (evidence.edge_uv[edge, 0] - u) * nu + (evidence.edge_uv[edge, 1] - v) * nv
    return side * off / length / pixels_per_metre(z, evidence.camera)


@njit(cache=True)
def _edges(R, t, samples, evidence, limits, offset, every, out):
    """Adds what one pose's edges say: `found` to `edges`, `scatter` and `unbent` of its verdict."""
    visible = found = samples_of_edge = matched = 0
    total = squares = 0.0
    for k in range(offset, len(samples.edge), every):
        state, edge = edge_state(R, t, k, samples, evidence, limits)
        if edge >= 0:
            off = inwards(R, t, k, edge, samples, evidence)
            total, squares, matched = total + off, squares + off * off, matched + 1
        weight = samples.edge_weight[k]
        if state == 2:
            out[0] += ENDS_WORTH * weight
        elif state >= 0:
            out[1 - state] += weight
            if state == 0 and crease_in_sight(R, t, k, samples, evidence):
                out[9] += weight
        visible, found, samples_of_edge = visible + (state >= 0), found + (state >= 1), samples_of_edge + 1
        if k + every >= len(samples.edge) or samples.edge[k + every] != samples.edge[k]:
            if visible >= 2 and visible >= MIN_VISIBLE_SHARE * samples_of_edge:
                out[6] += 1.0
                out[7] += found >= MIN_EDGE_SHARE * visible
            visible = found = samples_of_edge = 0
    if matched > 0:
        out[8] = np.sqrt(max(squares / matched - (total / matched) ** 2, 0.0))


@njit(cache=True)
def _surfaces(R, t, samples, evidence, limits, offset, every, out):
    """Adds what one pose's faces say: the square metres on readings, seen through, hidden and without a reading, and `lifted`."""
    total, count = 0.0, 0
    for k in range(offset, len(samples.face_weight), every):
        p, normal = samples.face_point[k], samples.face_normal[k]
        last = k - every
        if last >= 0 and (samples.face_normal[last] != normal).any():
            out[10] = max(out[10], abs(total) / count if count >= MIN_OF_ONE else 0.0)
            total, count = 0.0, 0
        x, y, z = _dot(R, 0, p) + t[0], _dot(R, 1, p) + t[1], _dot(R, 2, p) + t[2]
        cosine = facing(R, normal, x, y, z, evidence.camera)
        if cosine < GRAZING:
            continue
        seen, behind = reading_at(x, y, z, evidence, limits)
        rim = samples.face_rim[k] * cosine < limits.edge + 0.5 * evidence.pixel
        if rim and seen in (THROUGH, UNKNOWN):
            continue  # the margin that sensors lose at silhouettes
        if seen == UNKNOWN and cosine < STEEP:
            seen = HIDDEN  # too steep to blame the part for the missing reading
        if seen == ON:
            total, count = total + behind * cosine / ray_at(x, y, z, evidence.camera)[2], count + 1
        out[2 if seen == ON else 3 if seen == THROUGH else 4 if seen == HIDDEN else 5] += samples.face_weight[k]
    out[10] = max(out[10], abs(total) / count if count >= MIN_OF_ONE else 0.0)


@njit(cache=True)
def _unopposed(R, t, samples, evidence, limits):
    good = np.zeros(len(t), dtype=np.bool_)
    step = max(1, len(samples.face_weight) // GLANCE)
    for n in range(len(t)):
        on = through = 0
        for k in range(n % step, len(samples.face_weight), step):
            p = samples.face_point[k]
            x, y, z = _dot(R[n], 0, p) + t[n, 0], _dot(R[n], 1, p) + t[n, 1], _dot(R[n], 2, p) + t[n, 2]
            cosine = facing(R[n], samples.face_normal[k], x, y, z, evidence.camera)
            if cosine < GRAZING or samples.face_rim[k] * cosine < limits.edge:
                continue
            seen, _ = reading_at(x, y, z, evidence, limits)
            on, through = on + (seen == ON), through + (seen == THROUGH)
        good[n] = on > 0 and through <= MAX_THROUGH * (on + through)
    return good


@njit(cache=True)
def _verify(R, t, samples, evidence, limits, every):
    out = np.zeros((len(t), 11))
    for n in range(len(t)):
        _edges(R[n], t[n], samples, evidence, limits, n % every, every, out[n])
        _surfaces(R[n], t[n], samples, evidence, limits, n % every, every, out[n])
    return out
