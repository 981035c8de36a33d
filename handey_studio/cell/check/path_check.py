"""The independent check of an arm's path in a world of known bodies: exact link meshes by FCL, at a fine step in joint space.

It shares no collision code with the planners (see `checker`), only the corners of the world's convex bodies.
"""

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.cell.check.contacts import FINGER_SIDES, Contact, Mover, deepest, mover, near
from handey_studio.cell.check.penetration import polytope
from handey_studio.cell.check.shapes import Shape, box_shape, link_shape
from handey_studio.geometry import hull_triangles
from handey_studio.geometry.transforms import transform
from handey_studio.world import Held, World, arm_of, hand_hulls
from handey_studio.world.collision_bodies import solids_of

FREE_DEPTH_M = 2e-5  # what is less is rounding


def path_contacts(world: World, q_rad: NDArray, opening: float, held: Held | None = None, step_rad: float = 0.002) -> tuple[Contact, ...]:
    """Every pair of bodies that meets on a joint-linear path q_rad (n, joints) [rad] with the fingers `opening` [m] apart, at its deepest.

    The path is looked at every `step_rad`; a contact's `time` is the place on the path, in segments. Neighbouring links are not held
    against each other, nor the fixed base against the scene. Raises BadInput for a world with a depth map, which has no exact bodies.
    """
    if world.terrain is not None:
        raise BadInput("a path is checked among known bodies only; this world has a depth map.")
    places, q = _sampled(np.asarray(q_rad, dtype=float), step_rad)
    arm = _moving(world, q, opening, held)
    pairs = [(a, b) for i, a in enumerate(arm) for b in arm[i + 1 :] if abs(a.link - b.link) > 1]
    pairs += [(a, fixed) for fixed in _fixed(world, len(q)) for a in arm if a.link > 0]
    found = []
    for a, b in pairs:
        worst, when = deepest(a, b, near(a, b), FREE_DEPTH_M)
        if when >= 0:
            found.append(Contact((a.shape.name, b.shape.name), float(places[when]), worst, FREE_DEPTH_M, False))
    return tuple(found)


def _sampled(path: NDArray, step_rad: float) -> tuple[NDArray, NDArray]:
    """Places (k,) on the path, in segments, no more than `step_rad` apart in any joint, and the configurations (k, joints) there."""
    counts = np.maximum(1, np.ceil(np.abs(np.diff(path, axis=0)).max(axis=1) / step_rad)).astype(int)
    places = np.concatenate([*(k + np.arange(n) / n for k, n in enumerate(counts)), [float(len(counts))]])
    return places, np.stack([np.interp(places, np.arange(len(path)), column) for column in path.T], axis=1)


def _moving(world: World, q: NDArray, opening: float, held: Held | None) -> list[Mover]:
    """The links, the hand's boxes and the held part; what the hand carries counts as one link more than the arm has."""
    arm = arm_of(world.robot)
    links, T_hand = arm.link_poses(q), arm.hand_pose(q)
    moving = [mover(link_shape(body), body.link, links[:, body.link]) for body in arm.bodies]
    for name, corners in hand_hulls(world.robot, 0.0).items():
        shift = transform(None, (FINGER_SIDES.get(name, 0.0) * opening, 0.0, 0.0))
        moving.append(mover(box_shape(name, corners), arm.n + 1, T_hand @ shift))
    if held is not None:
        moving += [mover(_convex(held.name, piece), arm.n + 1, T_hand @ held.T_hand_part) for piece in held.part.pieces]
    return moving


def _fixed(world: World, count: int) -> list[Mover]:
    return [mover(_convex(name, corners), 0, np.broadcast_to(np.eye(4), (count, 4, 4))) for name, corners in solids_of(world)]


def _convex(name: str, corners: NDArray) -> Shape:
    return Shape(name, corners, hull_triangles(corners), (polytope(corners),))
