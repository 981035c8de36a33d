"""A closed solid that an object may be, and what every way of making one needs."""

from collections.abc import Sequence
from typing import NamedTuple

import manifold3d
import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry import Polyhedron, polyhedron_from_polygons
from handey_studio.modeling.suggesting.clues import UP
from handey_studio.modeling.suggesting.planes import BodyPlane

ALONG = np.cos(np.deg2rad(1.0))  # planes along an axis
LEAST_THICK_M = 0.002
MOST_ENDS = 3
SEEN_WORTH = 3.0  # a face that is seen tells three times as much as a rim of that length


class Shape(NamedTuple):
    """A candidate: `option` names it; `solid` None if it cannot be, with the `reason` and number. Sides of it that nothing shows
    are assumed `by` what is "hidden", or because it is "symmetric"."""

    option: str
    solid: Polyhedron | None
    reason: str = ""
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    by: str = "hidden"


def worth_of(plane: BodyPlane) -> tuple[bool, float]:
    """How much speaks for an end: of what it may stand on the highest, else faces and rims by their size."""
    if plane.kind == "support":
        return True, -plane.offset
    return False, plane.size * (SEEN_WORTH if plane.kind == "seen" else 1.0)


def basis_of(normal: NDArray) -> NDArray:
    """A rotation (3, 3) whose third column is the normal."""
    x = np.cross(UP, normal) if abs(normal @ UP) < 0.9 else np.array([1.0, 0.0, 0.0])
    x = x - (x @ normal) * normal
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(normal, x), normal], axis=1)


def plane_with(planes: Sequence[BodyPlane], of: tuple[int, int]) -> BodyPlane:
    return next(plane for plane in planes if of in plane.of)


def solid_of(made: manifold3d.Manifold) -> Polyhedron:
    mesh = made.to_mesh64()
    return polyhedron_from_polygons(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).tolist())
