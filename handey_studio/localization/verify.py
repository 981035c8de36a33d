"""Verify: does the view show what the part would show if it stood there (Handey 1987 §3)?

The paper counts the predicted edges that are present. Counting those that are visible and missing as well is what
tells a small box from its outline laid inside a bigger face. Edges behind a nearer surface say nothing.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.localization.edges import CONVEX
from handey_studio.localization.evidence import KIND, Evidence, Limits, U, V, Z, in_image, nearest_edge, pixels_per_metre, ray_at
from handey_studio.localization.samples import ALONG, INTO_LEFT, INTO_RIGHT, LEFT, RIGHT, PartSamples
from handey_studio.localization.shares import shared
from handey_studio.sensing.drawing import project

ON, HIDDEN, THROUGH, UNKNOWN = 0, 1, 2, 3
GRAZING = 0.12  # cosine; a face seen more edge-on than this gives no readings to count on
MIN_OF_ONE = 4  # samples of a face before their mean counts
STEEP = 0.4  # cosine; a face seen more squarely than this should give readings
UNREAD_COST = 0.3  # of a reading that sees through: no reading where there should be one
ENDS_WORTH = 0.5  # of a found edge: the surface ends within the tolerance, but raggedly
GLANCE, MOST_GLANCES = 12, 200  # points of faces in sight that the first look asks for, and how many points it tries to get them
MAX_THROUGH = 0.3
LEAST_POSES = 5  # that are worth a share
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


def verify(R: NDArray, t: NDArray, samples: PartSamples, evidence: Evidence, limits: Limits, every: int = 1) -> Verdict:
    """Verdicts on the poses R (n, 3, 3), t (n, 3) of the part in the sensor's frame, from every `every`-th sample."""
    R, t, counts = np.ascontiguousarray(R), np.ascontiguousarray(t), np.zeros((len(t), 11))
    shared(lambda first, last: _verify(R, t, samples, evidence, limits, every, (first, last), counts), len(t), LEAST_POSES)
    lengths_and_areas = (0, 1, 2, 3, 4, 5, 9)
    counts[:, lengths_and_areas] *= every
    return Verdict(*counts.T)


def unopposed(R: NDArray, t: NDArray, samples: PartSamples, evidence: Evidence, limits: Limits) -> NDArray:
    """Numbers of the poses R (n, 3, 3), t (n, 3) that a glance does not rule out: the sensor sees through less than `MAX_THROUGH` of
    the few points of the faces that it looks at."""
    R, t, good = np.ascontiguousarray(R), np.ascontiguousarray(t), np.zeros(len(t), dtype=np.bool_)
    shared(lambda first, last: _unopposed(R, t, samples, evidence, limits, (first, last), good), len(t), 20 * LEAST_POSES)
    return np.nonzero(good)[0]


@njit(cache=True, error_model="numpy")
def reading_at(x, y, z, depth, camera, limits):
    """How the reading at a point's pixel stands to it (ON, HIDDEN, THROUGH, UNKNOWN), and how far behind it [m]."""
    u, v = project(x, y, z, camera)
    i, j = int(np.rint(u)), int(np.rint(v))
    if z <= 0.0 or i < 0 or j < 0 or i >= depth.shape[1] or j >= depth.shape[0]:
        return UNKNOWN, 0.0
    behind = depth[j, i] - z
    if np.isnan(behind):
        return UNKNOWN, 0.0
    if behind < -limits.hide:
        return HIDDEN, behind
    return (THROUGH if behind > limits.through else ON), behind


@njit(cache=True, error_model="numpy", inline="always")
def placed(R, t, points, k):
    """Point number k of a part at a pose."""
    x, y, z = points[k, 0], points[k, 1], points[k, 2]
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z + t[0],
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z + t[1],
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z + t[2],
    )


@njit(cache=True, error_model="numpy")
def turned(R, directions):
    """Directions (..., 3) of a part at a pose."""
    out = np.empty_like(directions)
    flat, into = directions.reshape(-1, 3), out.reshape(-1, 3)
    for k in range(len(flat)):
        for r in range(3):
            into[k, r] = R[r, 0] * flat[k, 0] + R[r, 1] * flat[k, 1] + R[r, 2] * flat[k, 2]
    return out


@njit(cache=True, error_model="numpy", inline="always")
def facing(nx, ny, nz, x, y, z, camera):
    """Cosine between a face's outward normal and the way back to the sensor, at a point of it."""
    rx, ry, rz = ray_at(x, y, z, camera)
    return -(nx * rx + ny * ry + nz * rz)


@njit(cache=True, error_model="numpy", inline="always")
def vector(directions, e, which):
    """One of the directions of edge number e."""
    return directions[e, which, 0], directions[e, which, 1], directions[e, which, 2]


@njit(cache=True, error_model="numpy")
def edge_state(x, y, z, directions, e, concave, depth, nearest, edges, camera, pixel, limits):
    """One edge sample at a place, of edge number e with `directions` (e, 5, 3) there: 1 found, 2 no edge pixel but the surface ends
    there, 0 visible but missing, −1 not to be seen. Then the edge pixel that was found, or −1, how far [m] it lies inwards, and
    whether the faces left and right of the edge look at the sensor."""
    nx, ny, nz = vector(directions, e, LEFT)
    left = facing(nx, ny, nz, x, y, z, camera) >= GRAZING
    nx, ny, nz = vector(directions, e, RIGHT)
    right = facing(nx, ny, nz, x, y, z, camera) >= GRAZING
    inset, in_sight = limits.edge + pixel, False
    for side in range(INTO_LEFT if left else INTO_RIGHT, INTO_RIGHT + 1 if right else INTO_RIGHT):
        ix, iy, iz = vector(directions, e, side)
        seen, _ = reading_at(x + inset * ix, y + inset * iy, z + inset * iz, depth, camera, limits)
        in_sight = in_sight or seen in (ON, THROUGH)
    if not in_sight:
        return -1, -1, 0.0, left, right
    ax, ay, az = vector(directions, e, ALONG)
    du, dv = in_image(x, y, z, ax, ay, az, camera)
    k, sideways = nearest_edge(x, y, z, du, dv, nearest, edges, camera)
    close = k >= 0 and sideways <= limits.edge + 0.7 * pixel and abs(edges[k, Z] - z) <= limits.edge_depth
    ix, iy, iz = vector(directions, e, INTO_LEFT if left else INTO_RIGHT)
    off = inwards(x, y, z, du, dv, ix, iy, iz, edges[k, U], edges[k, V], camera) if close else 0.0
    if left and right:
        return (1, k, off, left, right) if close else (0, -1, 0.0, left, right)
    # a silhouette: sensors lose readings there, they do not add any, and a surface that bends away in sight is none
    if close and edges[k, KIND] != CONVEX and off >= -limits.outside - 0.7 * pixel:
        return 1, k, off, left, right
    beyond = limits.outside + pixel
    seen, _ = reading_at(x - beyond * ix, y - beyond * iy, z - beyond * iz, depth, camera, limits)
    if seen == HIDDEN:
        return (2 if concave else -1), -1, 0.0, left, right  # at a concave edge the part's own wall rises
    return (0 if seen == ON else 2), -1, 0.0, left, right


@njit(cache=True, error_model="numpy")
def inwards(x, y, z, du, dv, ix, iy, iz, u_pixel, v_pixel, camera):
    """How far [m] an edge pixel lies from an edge sample across the edge, (du, dv) in the image, positive towards the face that is
    seen, into which (ix, iy, iz) points."""
    u, v = project(x, y, z, camera)
    iu, iv = in_image(x, y, z, ix, iy, iz, camera)
    side = 1.0 if dv * iu - du * iv > 0 else -1.0
    off = (u_pixel - u) * dv - (v_pixel - v) * du
    return side * off / (np.sqrt(du * du + dv * dv) * pixels_per_metre(z, camera) + 1e-12)


@njit(cache=True, error_model="numpy")
def edge_states(R, t, samples, evidence, limits):
    """What `edge_state` says of each edge sample at a pose (n,)."""
    states, posed = np.empty(len(samples.edge), dtype=np.int64), turned(R, samples.directions)
    depth, nearest, edges, camera, pixel = evidence
    for k in range(len(states)):
        e = samples.edge[k]
        x, y, z = placed(R, t, samples.edge_point, k)
        states[k] = edge_state(x, y, z, posed, e, samples.concave[e], depth, nearest, edges, camera, pixel, limits)[0]
    return states


@njit(cache=True, error_model="numpy")
def _edges(R, t, samples, evidence, limits, offset, every, out):
    """Adds what one pose's edges say: `found` to `edges`, `scatter` and `unbent` of its verdict."""
    points, edge, weights, concave = samples.edge_point, samples.edge, samples.edge_weight, samples.concave
    posed = turned(R, samples.directions)
    depth, nearest, edges, camera, pixel = evidence
    visible = found = samples_of_edge = matched = 0
    total = squares = 0.0
    for k in range(offset, len(edge), every):
        e = edge[k]
        x, y, z = placed(R, t, points, k)
        state, found_pixel, off, left, right = edge_state(x, y, z, posed, e, concave[e], depth, nearest, edges, camera, pixel, limits)
        if found_pixel >= 0:
            total, squares, matched = total + off, squares + off * off, matched + 1
        weight = weights[k]
        if state == 2:
            out[0] += ENDS_WORTH * weight
        elif state >= 0:
            out[1 - state] += weight
            if state == 0 and left and right:
                out[9] += weight
        visible, found, samples_of_edge = visible + (state >= 0), found + (state >= 1), samples_of_edge + 1
        if k + every >= len(edge) or edge[k + every] != e:
            if visible >= 2 and visible >= MIN_VISIBLE_SHARE * samples_of_edge:
                out[6] += 1.0
                out[7] += found >= MIN_EDGE_SHARE * visible
            visible = found = samples_of_edge = 0
    if matched > 0:
        out[8] = np.sqrt(max(squares / matched - (total / matched) ** 2, 0.0))


@njit(cache=True, error_model="numpy")
def _surfaces(R, t, samples, evidence, limits, offset, every, out):
    """Adds what one pose's faces say: the square metres on readings, seen through, hidden and without a reading, and `lifted`."""
    points, faces, weights, rims = samples.face_point, samples.face, samples.face_weight, samples.face_rim
    normals = turned(R, samples.normal)
    depth, camera, pixel = evidence.depth, evidence.camera, evidence.pixel
    total, count, before = 0.0, 0, -1
    for k in range(offset, len(faces), every):
        face = faces[k]
        if face != before:
            out[10] = max(out[10], abs(total) / count if count >= MIN_OF_ONE else 0.0)
            total, count, before = 0.0, 0, face
        x, y, z = placed(R, t, points, k)
        cosine = facing(normals[face, 0], normals[face, 1], normals[face, 2], x, y, z, camera)
        if cosine < GRAZING:
            continue
        seen, behind = reading_at(x, y, z, depth, camera, limits)
        rim = rims[k] * cosine < limits.edge + 0.5 * pixel
        if rim and seen in (THROUGH, UNKNOWN):
            continue  # the margin that sensors lose at silhouettes
        if seen == UNKNOWN and cosine < STEEP:
            seen = HIDDEN  # too steep to blame the part for the missing reading
        if seen == ON:
            total, count = total + behind * cosine / ray_at(x, y, z, camera)[2], count + 1
        out[2 if seen == ON else 3 if seen == THROUGH else 4 if seen == HIDDEN else 5] += weights[k]
    out[10] = max(out[10], abs(total) / count if count >= MIN_OF_ONE else 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _unopposed(R, t, samples, evidence, limits, poses, good):
    points, faces, rims, depth, camera = samples.face_point, samples.face, samples.face_rim, evidence.depth, evidence.camera
    stride = _spreading(len(faces))
    for n in range(poses[0], poses[1]):
        normals = turned(R[n], samples.normal)
        on = through = 0
        k = n % len(faces)
        for _ in range(min(len(faces), MOST_GLANCES)):
            k = (k + stride) % len(faces)
            face = faces[k]
            x, y, z = placed(R[n], t[n], points, k)
            cosine = facing(normals[face, 0], normals[face, 1], normals[face, 2], x, y, z, camera)
            if cosine < GRAZING or rims[k] * cosine < limits.edge:
                continue
            seen, _ = reading_at(x, y, z, depth, camera, limits)
            on, through = on + (seen == ON), through + (seen == THROUGH)
            if on + through == GLANCE or through > MAX_THROUGH * GLANCE:
                break
        good[n] = on > 0 and through <= MAX_THROUGH * (on + through)


@njit(cache=True)
def _spreading(count):
    """A step by which one comes to every one of `count` numbers, and to far ones first."""
    step = max(1, int(0.618 * count))
    while np.gcd(step, count) > 1:
        step += 1
    return step


@njit(cache=True, nogil=True, error_model="numpy")
def _verify(R, t, samples, evidence, limits, every, poses, out):
    for n in range(poses[0], poses[1]):
        _edges(R[n], t[n], samples, evidence, limits, n % every, every, out[n])
        _surfaces(R[n], t[n], samples, evidence, limits, n % every, every, out[n])
