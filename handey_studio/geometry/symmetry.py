"""The rotations that map a polyhedron onto itself: poses that differ by one of them look the same."""

from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from handey_studio.base import frozen_array
from handey_studio.geometry.polyhedron import Polyhedron
from handey_studio.geometry.transforms import transform

SAME_M = 1e-4  # a tenth of a millimetre: below what any of our sensors can tell apart


def symmetries(solid: Polyhedron, tolerance: float = SAME_M) -> NDArray:
    """T_part_part (k, 4, 4), the identity first: proper rigid motions that map corners on corners and faces on faces.

    They leave the centroid where it is, so each is a rotation about it. Three corners in general position determine
    one; candidates are triples of corners with the same distances.
    """
    centre = solid.volume_and_centroid[1]
    corners = solid.vertices - centre
    tree = KDTree(corners)
    radii = np.linalg.norm(corners, axis=1)
    first, second = _frame_corners(corners)
    dots, crossed = corners @ corners.T, np.linalg.norm(np.cross(corners[:, None], corners[None]), axis=-1)
    found = [np.eye(4)]
    for i, j in permutations(range(len(corners)), 2):
        if abs(radii[i] - radii[first]) > tolerance or abs(radii[j] - radii[second]) > tolerance:
            continue
        if max(abs(dots[i, j] - dots[first, second]), abs(crossed[i, j] - crossed[first, second])) > tolerance * solid.diameter:
            continue
        R = _basis(corners[i], corners[j]) @ _basis(corners[first], corners[second]).T
        distances, image = tree.query(corners @ R.T)
        if distances.max() <= tolerance and _maps_faces(solid, np.asarray(image)):
            T = transform(R, centre - R @ centre)
            if all(np.abs(T[:3, :3] - S[:3, :3]).max() > 1e-3 for S in found):
                found.append(T)
    return frozen_array(np.array(found))


def _frame_corners(corners: NDArray) -> tuple[int, int]:
    """Two corners that with the centroid span a plane as openly as possible."""
    first = int(np.argmax(np.linalg.norm(corners, axis=1)))
    spread = np.linalg.norm(np.cross(corners[first], corners), axis=1)
    return first, int(np.argmax(spread))


def _basis(u: NDArray, v: NDArray) -> NDArray:
    x = u / np.linalg.norm(u)
    z = np.cross(u, v)
    z = z / np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _maps_faces(solid: Polyhedron, image: NDArray) -> bool:
    loops = {frozenset(face.outer) for face in solid.faces}
    return all(frozenset(int(image[c]) for c in face.outer) in loops for face in solid.faces)
