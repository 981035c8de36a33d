"""A mesh that is nearly a polyhedron made one: its triangles clustered into planes, its faces rebuilt exactly planar where planes meet.

Where three regions or more touch, their planes meet in a corner; a face's loop goes from corner to corner along its region's border. The
greatest distance between the old surface and the new one is told.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, measured
from handey_studio.geometry import Face, Polyhedron, polyhedron_from_polygons
from handey_studio.geometry.distances import signed_distances, surface_of
from handey_studio.world.numbering import pieces
from handey_studio.world.plane_clusters import neighbours, plane_clusters, region_planes

MAX_TRIANGLES = 200_000
MOST_FACES = 200  # of a part that somebody designed; more come from a scan or from roundness
PARALLEL = 0.02  # planes that meet with a smaller least singular value have no corner that means anything
FAR = 6.0  # a corner farther from where its regions touch than so many tolerances (and edges of the mesh) is none
FAR_EDGES = 3.0
MOST_DEVIATION = 2.0  # tolerances that the new surface may be off: a corner of two planes is farther off than either
ADVICE = "try another tolerance, or model it from a scan"
Touching = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Simplified(Value):
    """The `solid`, and the greatest distance `deviation` [m] of the mesh's corners from its surface."""

    solid: Polyhedron
    deviation: float


def simplified(corners: NDArray, triangles: NDArray, tolerance: float) -> Simplified:
    """A polyhedron within about `tolerance` [m] of a closed mesh: corners (n, 3) [m], triangles (t, 3) outward.

    Raises BadInput with one sentence where the mesh is too large, or no polyhedron is so near to it.
    """
    if len(triangles) > MAX_TRIANGLES:
        raise BadInput(f"it has {len(triangles)} triangles, the limit for simplifying is {MAX_TRIANGLES}; thin the mesh out first.")
    regions = plane_clusters(corners, triangles, tolerance)
    count = int(regions.max()) + 1
    if not 4 <= count <= MOST_FACES:
        raise BadInput(f"within {measured(tolerance, 'm')} it has {count} planes; a polyhedral part has 4 to {MOST_FACES}: {ADVICE}.")
    planes = region_planes(corners, triangles, regions)
    incident = _incident(triangles, regions)
    touching = {vertex: some for vertex, some in enumerate(incident) if len(some) >= 3}
    places = {some: _meeting(planes[list(some)]) for some in set(touching.values())}
    _check_near(corners, triangles, touching, places, tolerance)
    solid = _rebuilt(_loops(triangles, regions, touching), places)
    deviation = float(np.abs(signed_distances(surface_of(solid), corners)[0]).max())
    if deviation > MOST_DEVIATION * tolerance:
        raise BadInput(f"its faces rebuilt within {measured(tolerance, 'm')} are {measured(deviation, 'm')} off somewhere; {ADVICE}.")
    return Simplified(solid, deviation)


def _incident(triangles: NDArray, regions: NDArray) -> list[Touching]:
    """The regions around each corner of the mesh."""
    pairs = np.unique(np.c_[triangles.ravel(), np.repeat(regions, 3)], axis=0)
    found: list[list[int]] = [[] for _ in range(int(triangles.max()) + 1)]
    for vertex, region in pairs.tolist():
        found[vertex].append(region)
    return [tuple(some) for some in found]


def _meeting(planes: NDArray) -> NDArray:
    """The point (3,) [m] where planes (k, 4) meet, nearest to all of more than three; NaN where they hardly do."""
    if np.linalg.svd(planes[:, :3], compute_uv=False)[2] < PARALLEL:
        return np.full(3, np.nan)
    return np.linalg.lstsq(planes[:, :3], planes[:, 3], rcond=None)[0]


def _check_near(
    corners: NDArray, triangles: NDArray, touching: dict[int, Touching], places: dict[Touching, NDArray], tolerance: float
) -> None:
    """The planes must meet where their regions do."""
    sides = corners[triangles] - corners[np.roll(triangles, -1, axis=1)]
    reach = FAR * tolerance + FAR_EDGES * float(np.quantile(np.linalg.norm(sides, axis=2), 0.9))
    for vertex, some in touching.items():
        off = float(np.linalg.norm(places[some] - corners[vertex]))
        if not off <= reach:
            at = ", ".join(f"{1e3 * x:.1f}" for x in corners[vertex])
            raise BadInput(f"{len(some)} of its planes touch at {at} mm but do not meet in a corner there; {ADVICE}.")


def _loops(triangles: NDArray, regions: NDArray, touching: dict[int, Touching]) -> list[list[list[Touching]]]:
    """Each region's border as loops of corners; a corner is named by the regions that touch there."""
    beside = neighbours(triangles)
    outward = regions[beside] != regions[:, None]
    left = {(int(t), int(k)) for t, k in np.argwhere(outward)}
    loops: list[list[list[Touching]]] = [[] for _ in range(int(regions.max()) + 1)]
    while left:
        first = t, k = min(left)
        border = []
        while True:
            left.discard((t, k))
            border.append(int(triangles[t, k]))
            t, k = _next_side(triangles, beside, outward, t, k)
            if (t, k) == first:
                break
        named = _without_spikes([touching[vertex] for vertex in border if vertex in touching])
        if named:
            loops[int(regions[t])].append(named)
    return loops


def _next_side(triangles: NDArray, beside: NDArray, outward: NDArray, t: int, k: int) -> tuple[int, int]:
    """The side of the region's border that begins where side k of triangle t ends."""
    corner, k = triangles[t, (k + 1) % 3], (k + 1) % 3
    while not outward[t, k]:
        t = int(beside[t, k])
        k = int(np.nonzero(triangles[t] == corner)[0][0])
    return t, k


def _without_spikes(loop: list[Touching]) -> list[Touching]:
    """Without corners that follow themselves, and without ways there and straight back."""
    changed = True
    while changed and len(loop) > 2:
        changed = False
        for i in range(len(loop)):
            if loop[i] == loop[i - 1] or loop[i - 1] == loop[(i + 1) % len(loop)]:
                del loop[i]
                changed = True
                break
    return loop if len(loop) > 2 else []


def _rebuilt(loops: list[list[list[Touching]]], places: dict[Touching, NDArray]) -> Polyhedron:
    """The polyhedron whose faces have these loops."""
    named = sorted({some for face in loops for loop in face for some in loop})
    number = {some: k for k, some in enumerate(named)}
    corners = np.array([places[some] for some in named]).reshape(-1, 3)
    faces = []
    for loops_here in loops:
        numbered = [tuple(number[some] for some in loop) for loop in loops_here]
        if not numbered:
            raise BadInput(f"one of its planes has no corners: something on it is round; {ADVICE}.")
        areas = [np.linalg.norm(np.cross(corners[list(p)], np.roll(corners[list(p)], -1, axis=0)).sum(axis=0)) for p in numbered]
        outer = int(np.argmax(areas))
        faces.append(Face(numbered[outer], tuple(loop for k, loop in enumerate(numbered) if k != outer)))
    return polyhedron_from_polygons(corners, pieces(Polyhedron(corners, tuple(faces)))[0])
