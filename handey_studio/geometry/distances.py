"""Signed distances of many points from a polyhedron's surface.

A plane's distance bounds a face's from below: the face of the nearest plane comes first, and of most others nothing more is looked at than
their plane. Where several faces are equally near, at an edge or a corner, their distances weighed by their angles there tell
inside from outside (the angle-weighted normal of Bærentzen and Aanæs, 2005).
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.geometry.polyhedron import Polyhedron

FULL_TURN = 2.0 * np.pi


class Surface(NamedTuple):
    """A polyhedron as compiled code reads it: unit normals (m, 3), offsets (m,) [m], the axes (m, 2) that a face is flattened to, where
    its sides begin (m + 1,), and the sides (s, 7): start, end [m] and the face's angle [rad] at the start."""

    normals: NDArray
    offsets: NDArray
    axes: NDArray
    firsts: NDArray
    sides: NDArray


def surface_of(solid: Polyhedron) -> Surface:
    sides, firsts = [], [0]
    for face, normal in zip(solid.faces, solid.normals, strict=True):
        for loop in face.loops:
            corners = solid.vertices[list(loop)]
            sides.append(np.c_[corners, np.roll(corners, -1, axis=0), _angles(corners, normal)])
        firsts.append(firsts[-1] + sum(len(loop) for loop in face.loops))
    axes = np.array([np.delete(np.arange(3), np.argmax(np.abs(normal))) for normal in solid.normals])
    return Surface(np.array(solid.normals), np.array(solid.offsets), axes, np.array(firsts), np.concatenate(sides))


def signed_distances(surface: Surface, points: NDArray) -> tuple[NDArray, NDArray]:
    """Distances (n,) [m] of points (n, 3) [m] from the surface, + outside, - inside, and the nearest face (n,) of each."""
    distances, faces = np.empty(len(points)), np.empty(len(points), dtype=np.int64)
    _distances(*surface, np.ascontiguousarray(points, dtype=float), distances, faces)
    return distances, faces


def _angles(corners: NDArray, normal: NDArray) -> NDArray:
    """The inner angle [rad] (n,) at each corner of a loop, holes' corners as the face has them."""
    onward, back = np.roll(corners, -1, axis=0) - corners, np.roll(corners, 1, axis=0) - corners
    turn = np.cross(onward, back) @ normal
    return np.mod(np.arctan2(turn, (onward * back).sum(axis=1)), FULL_TURN)


@njit(cache=True, nogil=True)
def _distances(normals, offsets, axes, firsts, sides, points, distances, faces):
    heights = np.empty(len(normals))
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        first = 0
        for f in range(len(normals)):
            heights[f] = normals[f, 0] * x + normals[f, 1] * y + normals[f, 2] * z - offsets[f]
            if abs(heights[f]) < abs(heights[first]):
                first = f
        best, best_face, weighed = np.inf, -1, 0.0
        for step in range(-1, len(normals)):
            f = first if step < 0 else step
            height = heights[f]
            if step == first or height * height > best * (1.0 + 1e-9) + 1e-18:
                continue
            square, angle = _to_face(x, y, z, height, normals, axes, firsts, sides, f)
            if square > best * (1.0 + 1e-9) + 1e-18:
                continue
            if square < best * (1.0 - 1e-9) - 1e-18:
                weighed, best_face = 0.0, -1
            best = min(best, square)
            weighed += angle * height
            if best_face < 0 or abs(height) > abs(heights[best_face]):
                best_face = f
        faces[i] = best_face
        distances[i] = np.sqrt(best) if weighed >= 0.0 else -np.sqrt(best)


@njit(cache=True, nogil=True)
def _to_face(x, y, z, height, normals, axes, firsts, sides, f):
    """Squared distance [m²] of a point from a face, and the face's angle [rad] about the nearest spot."""
    foot = (x - height * normals[f, 0], y - height * normals[f, 1], z - height * normals[f, 2])
    i, j = axes[f, 0], axes[f, 1]
    p, q, odd = foot[i], foot[j], False
    for k in range(firsts[f], firsts[f + 1]):
        b, d = sides[k, j], sides[k, 3 + j]
        if (b > q) != (d > q) and p < sides[k, i] + (q - b) / (d - b) * (sides[k, 3 + i] - sides[k, i]):
            odd = not odd
    if odd:
        return height * height, FULL_TURN
    nearest, angle = np.inf, FULL_TURN
    for k in range(firsts[f], firsts[f + 1]):
        ux, uy, uz = sides[k, 3] - sides[k, 0], sides[k, 4] - sides[k, 1], sides[k, 5] - sides[k, 2]
        vx, vy, vz = x - sides[k, 0], y - sides[k, 1], z - sides[k, 2]
        share = (ux * vx + uy * vy + uz * vz) / (ux * ux + uy * uy + uz * uz)
        if share >= 1.0:
            continue  # the next side starts there
        share = max(share, 0.0)
        vx, vy, vz = vx - share * ux, vy - share * uy, vz - share * uz
        square = vx * vx + vy * vy + vz * vz
        if square < nearest:
            nearest, angle = square, sides[k, 6] if share == 0.0 else 0.5 * FULL_TURN
    return nearest, angle
