"""What a part would show: points on its edges and faces, taken once per part."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.localization.pairs import ModelEdges, model_edges
from handey_studio.world.part import Part

EDGE_SAMPLES = 320
FACE_SAMPLES = 900
DENSER = 6  # times as many for the last refinement, which averages the noise of readings
THINNING = 2
MIN_PER_EDGE = 4
MIN_PER_FACE = 12
ALONG, LEFT, RIGHT, INTO_LEFT, INTO_RIGHT = range(5)  # directions of an edge


class PartSamples(NamedTuple):
    """Points on a part, in its frame [m].

    Edges: `edge_point` (n, 3), its number `edge` (n,) in the table of model edges, and `edge_weight` (n,) [m], the length it stands
    for. Of each model edge the unit `directions` (e, 5, 3): ALONG it, outward normals of the faces LEFT and RIGHT of it, INTO_LEFT and
    INTO_RIGHT from the edge into its faces; whether it is `concave` (e,). Faces: `face_point` (m, 3), its number `face` (m,) among the
    part's faces, `face_weight` (m,) [m²], and `face_rim` (m,) [m], how far it is from the nearest edge; the outward `normal` (f, 3)
    of each face.
    """

    edge_point: NDArray
    edge: NDArray
    edge_weight: NDArray
    directions: NDArray
    concave: NDArray
    face_point: NDArray
    face: NDArray
    face_weight: NDArray
    face_rim: NDArray
    normal: NDArray


@lru_cache(maxsize=64)
def part_samples(part: Part, density: int = 1) -> PartSamples:
    """Points spread evenly over a part's edges and faces."""
    edges = model_edges(part)
    spacing = 2.0 * edges.half.sum() / (EDGE_SAMPLES * min(density, 3))
    counts = np.maximum(np.rint(2.0 * edges.half / spacing).astype(int), MIN_PER_EDGE)
    number = np.repeat(np.arange(len(counts)), counts)
    place = np.concatenate([(np.arange(n) + 0.5) / n * 2.0 - 1.0 for n in counts])
    points = edges.middle[number] + (place * edges.half[number])[:, None] * edges.direction[number]
    weight = (2.0 * edges.half / counts)[number]
    face_point, face, face_weight = _face_samples(part, density * FACE_SAMPLES)
    rim, normals = _distance_to_edges(face_point, edges), np.array(part.solid.normals)
    return PartSamples(points, number, weight, _directions(edges), edges.concave, face_point, face, face_weight, rim, normals)


def _directions(edges: ModelEdges) -> NDArray:
    """(e, 5, 3) as in `PartSamples`."""
    into_left, into_right = np.cross(edges.left, edges.direction), -np.cross(edges.right, edges.direction)
    return np.stack([edges.direction, edges.left, edges.right, into_left, into_right], axis=1)


@lru_cache(maxsize=64)
def thinned(part: Part) -> PartSamples:
    """One in `THINNING` of a part's samples, for a first refinement."""
    samples = part_samples(part)
    of_points = ("edge_point", "edge", "edge_weight", "face_point", "face", "face_weight", "face_rim")
    return samples._replace(**{key: np.ascontiguousarray(getattr(samples, key)[::THINNING]) for key in of_points})


def _distance_to_edges(points: NDArray, edges: ModelEdges) -> NDArray:
    """Distance (m,) [m] of points (m, 3) to the nearest edge."""
    from_middle = points[:, None] - edges.middle
    along = np.clip(np.einsum("mni,ni->mn", from_middle, edges.direction), -edges.half, edges.half)
    return np.linalg.norm(from_middle - along[..., None] * edges.direction, axis=2).min(axis=1)


def _face_samples(part: Part, wanted: int) -> tuple[NDArray, NDArray, NDArray]:
    """Points on the faces from a low-discrepancy sequence over each triangle, their faces, and the area that each stands for."""
    solid = part.solid
    points, faces, weights = [], [], []
    total = sum(_area(solid.vertices[t]) for f in range(len(solid.faces)) for t in solid.face_triangles(f))
    for f in range(len(solid.faces)):
        triangles = solid.vertices[solid.face_triangles(f)]
        areas = np.array([_area(t) for t in triangles])
        for corners, area in zip(triangles, areas, strict=True):
            n = max(round(wanted * area / total), int(np.ceil(MIN_PER_FACE * area / areas.sum())))
            points.append(_spread(corners, n))
            faces.append(np.full(n, f))
            weights.append(np.full(n, area / n))
    return np.concatenate(points), np.concatenate(faces), np.concatenate(weights)


def _area(corners: NDArray) -> float:
    return float(np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])) / 2)


def _spread(corners: NDArray, n: int) -> NDArray:
    """n points (n, 3) spread over a triangle: the golden-ratio sequence, folded into the triangle."""
    a, b = np.modf(0.5 + np.arange(1, n + 1)[:, None] * (0.7548776662466927, 0.5698402909980532))[0].T
    fold = a + b > 1
    a, b = np.where(fold, 1 - a, a), np.where(fold, 1 - b, b)
    return corners[0] + a[:, None] * (corners[1] - corners[0]) + b[:, None] * (corners[2] - corners[0])
