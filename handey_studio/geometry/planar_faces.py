"""The planar faces of a closed mesh: neighbouring triangles in one plane made polygons, which may have holes."""

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.geometry.polyhedron import Face, area_vector

COPLANAR_RAD = np.deg2rad(0.2)  # triangles within this angle of the largest one of a face belong to it
STRAIGHT_RAD, STRAIGHT_M = 1e-4, 1e-7  # a corner that turns less, or is nearer to the line past it, is none: STL rounds to float32
SLIVER_M = 2e-6  # the normal of a triangle lower than this means nothing: rounded corners turn it about


def planar_faces(corners: NDArray, triangles: NDArray) -> list[Face]:
    """Faces of a closed mesh, corners (n, 3) [m] and triangles (t, 3) outward, in the order of their first triangles.

    Each grows from its largest triangle. A sliver joins the first face that reaches it, and only that one: faces that are not in one plane
    never come together through it. Raises BadInput when a face touches itself at a corner.
    """
    owner = {(int(t[k]), int(t[(k + 1) % 3])): i for i, t in enumerate(triangles) for k in range(3)}
    region = _regions(corners, triangles, owner)
    borders: dict[int, dict[int, int]] = defaultdict(dict)
    for (p, q), i in owner.items():
        if region[owner[q, p]] != region[i]:
            borders[int(region[i])][p] = q
    first = {r: int(np.argmax(region == r)) for r in borders}
    normals = _crosses(corners, triangles)
    return [_face(corners, normals[region == r].sum(axis=0), borders[r]) for r in sorted(borders, key=first.__getitem__)]


def without_straight_corners(corners: NDArray, faces: list[Face]) -> list[Face]:
    """Without corners that lie on a straight line in every loop that they belong to."""
    bent: set[int] = set()
    for face in faces:
        for loop in face.loops:
            for before, here, after in zip(loop[-1:] + loop[:-1], loop, loop[1:] + loop[:1], strict=True):
                if not _is_straight(corners[here] - corners[before], corners[after] - corners[here]):
                    bent.add(here)
    keep = [[tuple(c for c in loop if c in bent) for loop in face.loops] for face in faces]
    return [Face(loops[0], tuple(loops[1:])) for loops in keep]


def _is_straight(u: NDArray, v: NDArray) -> bool:
    """Whether a way u and then v (3,) [m] turns by nothing that means anything."""
    turn = np.linalg.norm(np.cross(u, v))
    return bool(turn <= STRAIGHT_RAD * np.linalg.norm(u) * np.linalg.norm(v) or turn <= STRAIGHT_M * np.linalg.norm(u + v))


def _crosses(corners: NDArray, triangles: NDArray) -> NDArray:
    """Along the normal of each triangle, twice its area long (t, 3) [m²]."""
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _regions(corners: NDArray, triangles: NDArray, owner: dict[tuple[int, int], int]) -> NDArray:
    """A number (t,) for each triangle, the same for those of one face."""
    crosses = _crosses(corners, triangles)
    doubled = np.linalg.norm(crosses, axis=1)
    longest = np.linalg.norm(corners[triangles] - corners[np.roll(triangles, -1, axis=1)], axis=2).max(axis=1)
    sliver = doubled < SLIVER_M * longest
    normals = crosses / np.maximum(doubled, 1e-30)[:, None]
    beside = np.array([[owner[int(t[(k + 1) % 3]), int(t[k])] for k in range(3)] for t in triangles])
    region = np.full(len(triangles), -1)
    for seed in np.argsort(-doubled, kind="stable"):
        if region[seed] < 0:
            off = np.abs((corners[triangles] - corners[triangles[seed, 0]]) @ normals[seed]).max(axis=1)
            joins = (sliver & (off < SLIVER_M) | (np.linalg.norm(normals - normals[seed], axis=1) < COPLANAR_RAD)) & (region < 0)
            region[seed] = seed
            _grow(region, int(seed), beside, joins)
    return region


def _grow(region: NDArray, seed: int, beside: NDArray, joins: NDArray) -> None:
    """Every triangle that may join and is reached from the seed over sides gets its number."""
    waiting = [seed]
    while waiting:
        for other in beside[waiting.pop()].tolist():
            if joins[other] and region[other] < 0:
                region[other] = seed
                waiting.append(other)


def _face(corners: NDArray, normal: NDArray, border: dict[int, int]) -> Face:
    """Loops chained from the directed sides of a border; the outer one is the one that runs counter-clockwise."""
    border = dict(border)
    loops = []
    while border:
        first, after = next(iter(border.items()))
        loop = [first]
        del border[first]
        while after != first:
            loop.append(after)
            if after not in border:
                raise BadInput("a face touches itself at a corner; move the corner so that each face has a simple outline.")
            after = border.pop(after)
        loops.append(tuple(loop))
    areas = [area_vector(corners[list(loop)]) @ normal for loop in loops]
    outer = int(np.argmax(areas))
    return Face(loops[outer], tuple(loop for k, loop in enumerate(loops) if k != outer))
