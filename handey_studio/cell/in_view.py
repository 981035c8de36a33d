"""The arm itself as bodies that a range finder sees: the convex pieces of its links, and its hand."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.bodies import SolidBody
from handey_studio.geometry import Polyhedron, hull_triangles
from handey_studio.geometry.polyhedron import Face
from handey_studio.world import Arm, Robot, arm_of, hand_hulls


def arm_bodies(arm: Arm, q: NDArray, opening: float) -> tuple[SolidBody, ...]:
    """Links and hand at a configuration (joints,) [rad] with the fingers `opening` [m] apart, as bodies for the range finder's light."""
    poses = arm.link_poses(q)
    links = tuple(SolidBody(name, solid, poses[link], fixed=True) for name, link, solid in _links(arm.robot))
    T_world_hand = arm.hand_pose(q)
    return links + tuple(
        SolidBody(name, _hull(corners), T_world_hand, fixed=True) for name, corners in hand_hulls(arm.robot, opening).items()
    )


@lru_cache(maxsize=8)
def _links(robot: Robot) -> tuple[tuple[str, int, Polyhedron], ...]:
    """Name, link and solid of every piece, in its link's frame."""
    return tuple((f"{body.name} {k}", body.link, _hull(hull)) for body in arm_of(robot).bodies for k, hull in enumerate(body.hulls))


def _hull(corners: NDArray) -> Polyhedron:
    return Polyhedron(np.asarray(corners), tuple(Face(tuple(triangle)) for triangle in hull_triangles(np.asarray(corners)).tolist()))
