"""Exact convex pieces of a polyhedron, which collision engines need: their meshes are hollow, or taken for hulls."""

import manifold3d
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.base import BadInput, frozen_array
from handey_studio.geometry.polyhedron import Polyhedron

MAX_PIECES = 64
CONVEX_SHARE = 1.0 - 1e-6  # a solid that fills this share of its hull is convex


def convex_pieces(solid: Polyhedron) -> tuple[NDArray, ...]:
    """Corners (k, 3) [m] of convex pieces that together are exactly the solid.

    The solid is cut along the plane of one of the faces at a concave edge, until no concave edge is left.
    """
    mesh = manifold3d.Mesh64(np.array(solid.vertices), np.array(solid.triangles, dtype=np.uint64))
    whole = manifold3d.Manifold(mesh)
    if whole.is_empty():
        raise BadInput("the part's surface is not a closed solid; repair the mesh.")
    planes = [(solid.normals[f], float(solid.offsets[f])) for edge in solid.edges if edge.dihedral < -1e-6 for f in (edge.left, edge.right)]
    done: list[NDArray] = []
    todo = [(whole, 0)]
    while todo:
        piece, k = todo.pop()
        corners = np.asarray(piece.to_mesh64().vert_properties)[:, :3]
        if k == len(planes) or piece.volume() >= CONVEX_SHARE * ConvexHull(corners).volume:
            done.append(frozen_array(corners[ConvexHull(corners).vertices]))
            continue
        normal, offset = planes[k]
        for half in piece.split_by_plane(tuple(normal), offset):
            todo += [(part, k + 1) for part in half.decompose() if part.volume() > 1e-12]
        if len(done) + len(todo) > MAX_PIECES:
            raise BadInput(f"the part falls into more than {MAX_PIECES} convex pieces; simplify its shape.")
    return tuple(done)


def hull_triangles(corners: NDArray) -> NDArray:
    """Triangles (m, 3) of the hull of corners (n, 3), outward."""
    hull = ConvexHull(corners)
    a, b, c = (corners[hull.simplices[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    return np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
