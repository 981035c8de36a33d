"""Whether a true pile is a fair task: is the part in plain view, and is there room for a hand?"""

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.check.penetration import overlap, polytope, polytopes_of
from handey_studio.cell.stripes import Surfaces
from handey_studio.geometry.transforms import apply, inverse, rotation_about, transform
from handey_studio.sensing.stripes.range_finder import RangeFinder
from handey_studio.world.robot import Hand

VIEW_STEP_M = 0.002
CLOSING_TILT = np.sin(np.deg2rad(30.0))  # the closing direction lies within 30° of the table
PLAY_M = 0.005  # on each side of the part when the hand comes down over it
DEPTHS_M = (0.015, 0.022, 0.030)  # how far the fingertips reach below the part's top
TILTS_RAD = np.deg2rad((0.0, -25.0, 25.0))


def visible_share(finder: RangeFinder, bodies: Sequence[SolidBody], target: SolidBody) -> float:
    """How much of what the laser would see of the target alone it sees among the bodies, from 0 to 1."""
    x, y = (np.arange(0.0, side, VIEW_STEP_M) for side in finder.area)
    spots = np.stack([*np.meshgrid(x, y), np.zeros((len(y), len(x)))], axis=-1).reshape(-1, 3)
    beams = spots - finder.laser
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    T_range_world = inverse(finder.T_world_range)
    alone = Surfaces([target], T_range_world).first(finder.laser, beams)
    among = Surfaces([target, *(body for body in bodies if body.name != target.name)], T_range_world).first(finder.laser, beams)
    seen = among.face[alone.face >= 0] == alone.face[alone.face >= 0]
    return float(seen.mean()) if len(seen) else 0.0


def graspable(hand: Hand, target: SolidBody, bodies: Sequence[SolidBody], closing_tilt: float = CLOSING_TILT) -> bool:
    """Whether the open hand fits somewhere over two parallel faces of the target, from above, touching nothing, while it closes along a
    direction whose slope (a sine) is at most `closing_tilt`.

    A coarse look at a few hand positions: it says that the task is fair, not how to grasp.
    """
    others = [body for body in bodies if body.name != target.name]
    return any(_fits(hand, T_world_hand, opening, target, others) for T_world_hand, opening in _trials(hand, target, closing_tilt))


def _trials(hand: Hand, target: SolidBody, closing_tilt: float) -> list[tuple[NDArray, float]]:
    """Hand poses and openings over each pair of opposite faces."""
    normals = target.solid.normals @ target.T_world_body[:3, :3].T
    top = target.corners_world[:, 2].max()
    trials = []
    for f, normal in enumerate(normals):
        opposite = np.nonzero(normals @ normal < -1 + 1e-6)[0]
        for width in target.solid.offsets[f] + target.solid.offsets[opposite]:
            if abs(normal[2]) > closing_tilt or not 0 < width <= hand.opening_max - 2 * PLAY_M:
                continue
            for tilt, depth, place in product(TILTS_RAD, DEPTHS_M, _places(target, f, normal, width)):
                trials.append((_hand_over(normal, float(tilt), (*place[:2], max(place[2], top - depth))), width + 2 * PLAY_M))
    return trials


def _places(target: SolidBody, f: int, normal: NDArray, width: float) -> NDArray:
    """Points (k, 3) midway between the faces, below the corners' mean and towards each corner of the face."""
    corners = apply(target.T_world_body, target.solid.vertices[list(target.solid.faces[f].outer)])
    middle = corners.mean(axis=0)
    return np.concatenate([middle[None], middle + 0.5 * (corners - middle)]) - normal * width / 2


def _hand_over(normal: NDArray, tilt: float, tip: Sequence[float]) -> NDArray:
    """T_world_hand that closes along `normal`, comes from above, tilted in the grasp plane."""
    z = np.array([0.0, 0.0, -1.0]) + normal[2] * normal
    z = rotation_about(normal, tilt) @ (z / np.linalg.norm(z))
    return transform(np.stack([normal, np.cross(z, normal), z], axis=1), tip)


def _fits(hand: Hand, T_world_hand: NDArray, opening: float, target: SolidBody, others: Sequence[SolidBody]) -> bool:
    pick = np.array(list(product((False, True), repeat=3)))
    pieces = [polytope(np.where(pick, upper, lower)) for lower, upper in hand.boxes(opening).values()]
    return all(
        overlap(piece, T_world_hand, part, body.T_world_body) < 0
        for piece in pieces
        for body in (target, *others)
        for part in polytopes_of(body)
    )
