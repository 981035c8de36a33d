"""Where the arm, with its wrist in one posture, meets itself: for the cells of joints 2 and 3, as joint 1 does not matter."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.motion.certificate import Mover
from handey_studio.motion.cores import share
from handey_studio.world.collision_bodies import Shapes
from handey_studio.world.collision_queries import Chain, body_distance, forward, placed

NEAR_M = 0.03  # nearer than this the bodies themselves are measured, farther off the balls around them will do


def self_blocked(mover: Mover, values2: NDArray, values3: NDArray, others: NDArray) -> NDArray:
    """Cells (n2, n3) in whose centre a link up to the wrist's carrier meets what comes after it.

    The joints other than the arm's are at `others` (joints − 3,) [rad].
    """
    robot, shapes, chain = mover.model.world.robot, mover.bodies.shapes, mover.model.chain
    posture, arm = np.zeros(len(robot.joint_names)), robot.arm_index
    posture[robot.other_index] = others
    reach = _reach(shapes, forward(chain, posture), chain, int(arm[2]), mover.opening)
    links = shapes.link[shapes.pairs]
    before, after = links.min(axis=1), links.max(axis=1)
    upper = _some_pairs(shapes, (before > arm[0] + 1) & (before <= arm[2]) & (after > arm[2]))
    lower = _some_pairs(shapes, (before <= arm[0] + 1) & (after > arm[0] + 1))
    balls = _balls(shapes, mover.opening)
    folded, blocked = np.zeros((1, len(values3)), bool), np.zeros((len(values2), len(values3)), bool)
    _ranges(chain, upper, balls, mover.opening, posture, arm, values2, values3, reach, np.zeros(1, int), folded)
    share(lambda mine: _ranges(chain, lower, balls, mover.opening, posture, arm, values2, values3, reach, mine, blocked), len(values2))
    return blocked | folded


@njit(cache=True)
def _balls(shapes: Shapes, opening: float) -> NDArray:
    """A ball around each body (b, 4) [m]: centre in its link's frame, and radius."""
    out = np.zeros((len(shapes.link), 4))
    for b in range(len(out)):
        corners = shapes.corners[shapes.first[b] : shapes.first[b + 1]]
        for axis in range(3):
            out[b, axis] = (corners[:, axis].min() + corners[:, axis].max()) / 2
        for c in range(len(corners)):
            x, y, z = corners[c, 0] - out[b, 0], corners[c, 1] - out[b, 1], corners[c, 2] - out[b, 2]
            out[b, 3] = max(out[b, 3], np.sqrt(x * x + y * y + z * z))
        for axis in range(3):
            out[b, axis] += shapes.slide[b, axis] * opening
    return out


def _some_pairs(shapes: Shapes, chosen: NDArray) -> Shapes:
    return shapes._replace(pairs=np.ascontiguousarray(shapes.pairs[chosen]))


@njit(cache=True)
def _reach(shapes: Shapes, poses: NDArray, chain: Chain, joint: int, opening: float) -> float:
    """Greatest distance [m] of a moving body's corners from the axis of a joint."""
    corners, T, most = placed(shapes, poses, opening), poses[joint + 1], 0.0
    axis = np.empty(3)
    for i in range(3):
        axis[i] = T[i, 0] * chain.axes[joint, 0] + T[i, 1] * chain.axes[joint, 1] + T[i, 2] * chain.axes[joint, 2]
    for b in range(len(shapes.link)):
        if shapes.link[b] > joint:
            for c in range(shapes.first[b], shapes.first[b + 1]):
                u, v, w = corners[c, 0] - T[0, 3], corners[c, 1] - T[1, 3], corners[c, 2] - T[2, 3]
                along = u * axis[0] + v * axis[1] + w * axis[2]
                most = max(most, u * u + v * v + w * w - along * along)
    return np.sqrt(most)


@njit(cache=True, nogil=True)
def _ranges(
    chain: Chain,
    shapes: Shapes,
    balls: NDArray,
    opening: float,
    posture: NDArray,
    arm: NDArray,
    values2: NDArray,
    values3: NDArray,
    reach: float,
    mine: NDArray,
    blocked: NDArray,
) -> None:
    """Marks the forbidden cells of the rows `mine`, in strides: what is far apart stays apart while joint 3 turns by a little."""
    q, step = posture.copy(), values3[1] - values3[0] if len(values3) > 1 else 1.0
    corners = np.empty_like(shapes.corners)
    for j in mine:
        m = 0
        while m < len(values3):
            q[arm[1]], q[arm[2]] = values2[j], values3[m]
            distance = _least(shapes, balls, forward(chain, q), opening, corners)
            blocked[j, m] = distance <= 0.0
            m += 1 + int(min(distance / (step * reach), float(len(values3))))


@njit(cache=True)
def _least(shapes: Shapes, balls: NDArray, poses: NDArray, opening: float, corners: NDArray) -> float:
    """A lower bound of the least distance [m] of two bodies, which where it is below `NEAR_M` is that distance."""
    least, placed = np.inf, np.zeros(len(balls), np.bool_)
    centres = np.empty((len(balls), 3))
    for b in range(len(balls)):
        T = poses[shapes.link[b]]
        for i in range(3):
            centres[b, i] = T[i, 0] * balls[b, 0] + T[i, 1] * balls[b, 1] + T[i, 2] * balls[b, 2] + T[i, 3]
    for pair in range(len(shapes.pairs)):
        a, b = int(shapes.pairs[pair, 0]), int(shapes.pairs[pair, 1])
        x, y, z = centres[a, 0] - centres[b, 0], centres[a, 1] - centres[b, 1], centres[a, 2] - centres[b, 2]
        apart = np.sqrt(x * x + y * y + z * z) - balls[a, 3] - balls[b, 3]
        if apart >= min(least, NEAR_M):
            least = min(least, apart)
            continue
        for body in (a, b):
            if not placed[body]:
                place_body(shapes, poses, opening, body, corners)
                placed[body] = True
        least = min(least, body_distance(shapes, corners, a, b, least))
        if least <= 1e-4:
            return 0.0
    return least


@njit(cache=True)
def place_body(shapes: Shapes, poses: NDArray, opening: float, b: int, corners: NDArray) -> None:
    """Writes the corners [m] of one body in the world."""
    T = poses[shapes.link[b]]
    u, v, w = shapes.slide[b, 0] * opening, shapes.slide[b, 1] * opening, shapes.slide[b, 2] * opening
    for c in range(shapes.first[b], shapes.first[b + 1]):
        x, y, z = shapes.corners[c, 0] + u, shapes.corners[c, 1] + v, shapes.corners[c, 2] + w
        for i in range(3):
            corners[c, i] = T[i, 0] * x + T[i, 1] * y + T[i, 2] * z + T[i, 3]
