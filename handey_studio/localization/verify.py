"""Verify: does the view show what the part would show if it stood there (Handey 1987 §3)?

The paper counts the predicted edges that are present. Counting those that are visible and missing as well is what
tells a small box from its outline laid inside a bigger face. Edges behind a nearer surface say nothing.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.localization.evidence import Evidence, Limits, ray_at
from handey_studio.localization.posed import GRAZING, HIDDEN, ON, THROUGH, UNKNOWN, facing, placed, reading_at, turned
from handey_studio.localization.predicted_edges import edge_state
from handey_studio.localization.samples import PartSamples
from handey_studio.localization.shares import shared

MIN_OF_ONE = 4  # samples of a face before their mean counts
STEEP = 0.4  # cosine; a face seen more squarely than this should give readings
UNREAD_COST = 0.3  # of a reading that sees through: no reading where there should be one
ENDS_WORTH = 0.5  # of a found edge: the surface ends within the tolerance, but raggedly
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
def _verify(R, t, samples, evidence, limits, every, poses, out):
    for n in range(poses[0], poses[1]):
        _edges(R[n], t[n], samples, evidence, limits, n % every, every, out[n])
        _surfaces(R[n], t[n], samples, evidence, limits, n % every, every, out[n])
