"""Exact shapes for checking a plan: link meshes as they are, the hand's boxes, the true bodies, and how deep two of them meet.

Convex pieces meet by their separating axes, which gives the exact depth. Link meshes meet by FCL's triangle trees, which
are hollow; so what lies wholly inside a mesh is found by its winding number.
"""

from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.base import Value, frozen_array
from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.check.penetration import Polytope, overlap, polytope, polytopes_of
from handey_studio.geometry import hull_triangles
from handey_studio.geometry.transforms import inverse
from handey_studio.world.link_body import LinkBody

fcl: Any = import_module("fcl")  # compiled, without type information

MAX_CONTACTS = 20
MESH_M = 1e-4  # least depth told for meshes whose surfaces cross: FCL's estimate may be zero there
CONTAINED_M = 0.01  # depth told for a shape wholly inside another, where no surfaces meet to measure it


@dataclass(frozen=True, eq=False)
class Shape(Value):
    """A closed surface: corners (n, 3) [m] and triangles (m, 3); `pieces` when it is known as convex ones, None for meshes."""

    name: str
    corners: NDArray
    triangles: NDArray
    pieces: tuple[Polytope, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", frozen_array(self.corners))
        object.__setattr__(self, "triangles", frozen_array(self.triangles, int))

    @cached_property
    def bounds(self) -> NDArray:
        """Lower and upper corner (2, 3) of the box around it in its own frame."""
        return np.stack([self.corners.min(axis=0), self.corners.max(axis=0)])

    @cached_property
    def planes(self) -> NDArray:
        """Planes (f, 4) [m], outward, that hold the shape: its faces when it is one convex piece, else its box's."""
        if self.pieces is not None and len(self.pieces) == 1:
            return np.unique(np.round(ConvexHull(self.corners).equations, 9), axis=0)
        axes = np.eye(3)
        return np.concatenate([np.c_[-axes, self.bounds[0]], np.c_[axes, -self.bounds[1]]])

    @cached_property
    def tree(self) -> Any:
        """FCL's triangle tree of the surface."""
        model = fcl.BVHModel()
        model.beginModel(len(self.corners), len(self.triangles))
        model.addSubModel(np.array(self.corners), np.array(self.triangles))
        model.endModel()
        return fcl.CollisionObject(model, fcl.Transform())

    def extents(self, poses: NDArray) -> tuple[NDArray, NDArray]:
        """Lower and upper corners (k, 3) of the axis-aligned boxes around it at poses (k, 4, 4)."""
        middle, half = self.bounds.mean(axis=0), np.ptp(self.bounds, axis=0) / 2
        centres = poses[:, :3, :3] @ middle + poses[:, :3, 3]
        reach = np.abs(poses[:, :3, :3]) @ half
        return centres - reach, centres + reach

    def holds(self, point: NDArray) -> bool:
        """Whether a point (3,) of its frame is inside, by the solid angle that the surface spans around it."""
        a, b, c = np.moveaxis(self.corners[self.triangles] - point, 1, 0)
        la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        dots = (np.einsum("ij,ij->i", p, q) * length for p, q, length in ((a, b, lc), (b, c, la), (c, a, lb)))
        angle = 2 * np.arctan2(volume, la * lb * lc + sum(dots)).sum()
        return bool(abs(angle) > 2 * np.pi)


def link_shape(link: LinkBody) -> Shape:
    """A link's exact mesh."""
    return Shape(link.name, link.vertices, link.triangles)


def box_shape(name: str, corners: NDArray) -> Shape:
    """One of the hand's boxes, corners (8, 3) [m]."""
    return Shape(name, corners, hull_triangles(corners), (polytope(corners),))


def body_shape(name: str, body: SolidBody) -> Shape:
    """A true body, under the name that the plan knows it by."""
    return Shape(name, body.solid.vertices, body.solid.triangles, polytopes_of(body))


def depth(a: Shape, T_world_a: NDArray, b: Shape, T_world_b: NDArray) -> float:
    """How deep [m] two shapes meet; 0 or less when they are apart. Exact between convex pieces, FCL's estimate with meshes."""
    if a.pieces is not None and b.pieces is not None:
        return max(overlap(p, T_world_a, q, T_world_b) for p in a.pieces for q in b.pieces)
    request = fcl.CollisionRequest(num_max_contacts=MAX_CONTACTS, enable_contact=True)
    result = fcl.CollisionResult()
    for shape, T in ((a, T_world_a), (b, T_world_b)):
        shape.tree.setTransform(fcl.Transform(T[:3, :3], T[:3, 3]))
    if fcl.collide(a.tree, b.tree, request, result):
        return max(MESH_M, *(abs(contact.penetration_depth) for contact in result.contacts))
    inside = _inside(a, T_world_a, b, T_world_b) or _inside(b, T_world_b, a, T_world_a)
    return CONTAINED_M if inside else 0.0


def _inside(inner: Shape, T_world_inner: NDArray, outer: Shape, T_world_outer: NDArray) -> bool:
    """Whether one shape lies wholly in another, when their surfaces do not meet."""
    T = inverse(T_world_outer) @ T_world_inner
    spot = T[:3, :3] @ inner.corners[0] + T[:3, 3]
    if (spot < outer.bounds[0]).any() or (spot > outer.bounds[1]).any():
        return False
    return outer.holds(spot)
