"""The slice configuration space of the three arm joints (Handey 1987 §4), called joints 1–3 here wherever in the chain they are.

Per slice of joint 1, and per value of joint 2 in it, the forbidden values of joints 2 and 3. A cell counts as free only if all of it is:
each sphere of the arm, at the cell's centre, keeps more clearance than half the cell can move it. The arm's bodies against
each other are looked at in the cells' centres only; there the path's certificate has the last word.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from handey_studio.base import Value, frozen_array
from handey_studio.motion.certificate import Mover
from handey_studio.motion.distance_field import Field, clearance_at, distance_field
from handey_studio.motion.wrist_box import ArmSpheres
from handey_studio.world.bounding_tree import box_gap
from handey_studio.world.collision_bodies import Shapes
from handey_studio.world.collision_queries import Chain, body_distance, bounds, forward, placed

TURN = 2 * np.pi
REACH = 0.75 * TURN  # the way round the other side, and a quarter turn to spare


@dataclass(frozen=True, eq=False)
class ConfigurationSpace(Value):
    """Cells of joints 1–3: cell k of joint i is centred at `lower[i] + (k + ½)·step` [rad], and ranges longer than a turn repeat.

    `joints` (3,) are their places in a configuration. `blocked` (n1, n2, n3) bool; `regions` (n1, n2, n3) numbers the free regions from 1,
    0 where blocked.
    """

    step: float
    joints: NDArray
    lower: NDArray
    blocked: NDArray
    regions: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", frozen_array(self.joints, int))
        object.__setattr__(self, "lower", frozen_array(self.lower))
        object.__setattr__(self, "blocked", frozen_array(self.blocked, bool))
        object.__setattr__(self, "regions", frozen_array(self.regions, np.int32))

    @property
    def centres(self) -> tuple[NDArray, ...]:
        """Centres [rad] of the cells of each joint."""
        return tuple(self.lower[i] + (np.arange(n) + 0.5) * self.step for i, n in enumerate(self.blocked.shape))

    def cell(self, q: NDArray) -> tuple[int, int, int]:
        """The cell that holds the arm joints of q; the nearest one when it lies beyond the last."""
        k = np.floor((np.asarray(q)[self.joints] - self.lower) / self.step).astype(int)
        i, j, m = np.clip(k, 0, np.array(self.blocked.shape) - 1)
        return int(i), int(j), int(m)

    def centre(self, cells: NDArray) -> NDArray:
        """Angles (..., 3) [rad] of cells (..., 3)."""
        return self.lower + (np.asarray(cells) + 0.5) * self.step

    def at(self, cell: NDArray, q: NDArray) -> NDArray:
        """The configuration q (n,) with its arm joints in the centre of a cell."""
        out = np.array(q, dtype=float)
        out[self.joints] = self.centre(cell)
        return out


def configuration_space(
    mover: Mover, spheres: ArmSpheres, wrist: NDArray, step: float, around: NDArray | None = None
) -> ConfigurationSpace:
    """The space of a mover's arm, whose wrist is enclosed by `spheres`; `step` [rad] must divide a turn.

    Where the arm's own bodies are compared its other joints are at `wrist` (joints − 3,) [rad]. Each arm joint ranges within its limits,
    and no farther than `REACH` from the configurations `around` (m, joints) [rad] when they are given: beyond that it is the same arm a
    turn on.
    """
    robot = mover.model.world.robot
    arm = robot.arm_index
    lower, upper = robot.lower[arm], robot.upper[arm]
    if around is not None:
        lower = lower + step * np.floor(np.maximum(around[:, arm].min(axis=0) - REACH - lower, 0.0) / step)
        upper = np.minimum(upper, around[:, arm].max(axis=0) + REACH)
    counts = np.maximum(np.floor((upper - lower) / step + 1e-9).astype(int), 1)
    turn = round(TURN / step)
    once = np.minimum(counts, turn)
    values = [lower[i] + (np.arange(once[i]) + 0.5) * step for i in range(3)]
    blocked = _blocked(mover, spheres, values, step)
    posture = np.zeros(len(robot.lower))
    posture[robot.other_index] = wrist
    blocked |= _self_blocked(mover.model.chain, mover.bodies.shapes, mover.opening, posture, arm, values[1], values[2])[None]
    whole = blocked[np.ix_(*(np.arange(counts[i]) % turn for i in range(3)))]
    regions = np.empty(whole.shape, np.int32)
    ndimage.label(~whole, structure=np.ones((3, 3, 3)), output=regions)
    return ConfigurationSpace(step, arm, lower, whole, regions)


def _blocked(mover: Mover, spheres: ArmSpheres, values: list[NDArray], step: float) -> NDArray:
    """Cells (n1, n2, n3) that the scene does not leave wholly free."""
    chain, field = mover.model.chain, distance_field(mover.model.world)
    centres, radii, links = np.array(spheres.centres), spheres.radii + mover.margin, np.array(spheres.links)
    robot = mover.model.world.robot
    arm, posture, halves = robot.arm_index, np.zeros(len(robot.lower)), np.full(len(robot.lower), step / 2)
    posture[robot.other_index] = spheres.ranges.mean(axis=0)
    halves[robot.other_index] = np.ptp(spheres.ranges, axis=0) / 2
    turns = _turns(chain, posture[: robot.carrier], arm[0], values[0])
    stage = np.searchsorted(arm, links)  # how many of the arm joints move a link
    tables = []
    for s in (1, 2, 3):
        mine = stage == s
        tables.append(
            _tables(chain, arm, posture[: robot.carrier], halves, centres[mine], radii[mine], links[mine], stage_values(values, s))
        )
    return _assemble(field, turns, tables[0], tables[1], tables[2])


@njit(cache=True)
def _turns(chain: Chain, posture: NDArray, joint: int, values: NDArray) -> NDArray:
    """Poses (n1, 4, 4) of the link that joint 1, number `joint` of the chain, moves."""
    turns, q = np.empty((len(values), 4, 4)), posture.copy()
    for i in range(len(values)):
        q[joint] = values[i]
        turns[i] = forward(chain, q)[joint + 1]
    return turns


def stage_values(values: list[NDArray], stage: int) -> tuple[NDArray, NDArray]:
    """The values of joints 2 and 3 on which the place of a link that `stage` arm joints move hangs; a single zero for a joint beyond it."""
    zero = np.zeros(1)
    return (values[1] if stage >= 2 else zero), (values[2] if stage >= 3 else zero)


@njit(cache=True)
def _needed(chain: Chain, poses: NDArray, link: int, x: float, y: float, z: float, halves: NDArray) -> float:
    """How far [m] the point x, y, z carried by a link can move while each joint stays within `halves` [rad] of where it is."""
    moved = 0.0
    for joint in range(link - 1, -1, -1):
        T, a = poses[joint + 1], chain.axes[joint]
        ax = T[0, 0] * a[0] + T[0, 1] * a[1] + T[0, 2] * a[2]
        ay = T[1, 0] * a[0] + T[1, 1] * a[1] + T[1, 2] * a[2]
        az = T[2, 0] * a[0] + T[2, 1] * a[1] + T[2, 2] * a[2]
        u, v, w = x - T[0, 3], y - T[1, 3], z - T[2, 3]
        along = u * ax + v * ay + w * az
        moved += halves[joint] * (np.sqrt(max(u * u + v * v + w * w - along * along, 0.0)) + moved)
    return moved


@njit(cache=True)
def _tables(
    chain: Chain,
    arm: NDArray,
    posture: NDArray,
    halves: NDArray,
    centres: NDArray,
    radii: NDArray,
    links: NDArray,
    values: tuple[NDArray, NDArray],
) -> tuple[NDArray, NDArray]:
    """Where k spheres on links `links` (k,) are in the frame of the link that joint 1 moves (n2, n3, k, 3).

    And the clearance (n2, n3, k) [m] that they need while each joint stays within `halves` of its cell's centre, or of `posture`.
    """
    n2, n3, k = len(values[0]), len(values[1]), len(radii)
    q = posture.copy()
    q[arm[0]] = 0.0
    where, need = np.empty((n2, n3, k, 3)), np.empty((n2, n3, k))
    p = np.empty(3)
    for j in range(n2):
        for m in range(n3):
            q[arm[1]], q[arm[2]] = values[0][j], values[1][m]
            poses = forward(chain, q)
            S = poses[arm[0] + 1]
            for s in range(k):
                T = poses[links[s]]
                for axis in range(3):
                    p[axis] = T[axis, 0] * centres[s, 0] + T[axis, 1] * centres[s, 1] + T[axis, 2] * centres[s, 2] + T[axis, 3]
                u, v, w = p[0] - S[0, 3], p[1] - S[1, 3], p[2] - S[2, 3]
                for axis in range(3):
                    where[j, m, s, axis] = S[0, axis] * u + S[1, axis] * v + S[2, axis] * w
                need[j, m, s] = radii[s] + _needed(chain, poses, links[s], p[0], p[1], p[2], halves)
    return where, need


@njit(cache=True)
def _meets(field: Field, T: NDArray, where: NDArray, need: NDArray, guess: int) -> int:
    """The first sphere found, given in the frame T, that lacks the clearance it needs, or -1; `guess` is looked at first.

    Neighbouring cells are mostly blocked by the same sphere.
    """
    for turn in range(-1, len(need)):
        s = guess if turn < 0 else turn
        x, y, z = where[s, 0], where[s, 1], where[s, 2]
        px = T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3]
        py = T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3]
        pz = T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3]
        if clearance_at(field, px, py, pz) < need[s]:
            return s
    return -1


@njit(cache=True)
def _assemble(
    field: Field, turns: NDArray, first: tuple[NDArray, NDArray], second: tuple[NDArray, NDArray], third: tuple[NDArray, NDArray]
) -> NDArray:
    """The slices: joint 1 turns the tables of the links. Where link 1 or 2 meets something the whole row is forbidden."""
    n1, n2, n3 = len(turns), second[1].shape[0], third[1].shape[1]
    blocked = np.zeros((n1, n2, n3), np.bool_)
    guess = 0
    for i in range(n1):
        if _meets(field, turns[i], first[0][0, 0], first[1][0, 0], 0) >= 0:
            blocked[i] = True
            continue
        for j in range(n2):
            if _meets(field, turns[i], second[0][j, 0], second[1][j, 0], 0) >= 0:
                blocked[i, j] = True
                continue
            for m in range(n3):
                met = _meets(field, turns[i], third[0][j, m], third[1][j, m], guess)
                if met >= 0:
                    blocked[i, j, m] = True
                    guess = met
    return blocked


@njit(cache=True)
def _self_blocked(
    chain: Chain, shapes: Shapes, opening: float, posture: NDArray, arm: NDArray, values2: NDArray, values3: NDArray
) -> NDArray:
    """Cells (n2, n3) in whose centre, with the other joints as in `posture` (n,), a link before the wrist's carrier meets what comes after.

    Joint 1 does not matter.
    """
    blocked = np.zeros((len(values2), len(values3)), np.bool_)
    q = posture.copy()
    for j in range(len(values2)):
        for m in range(len(values3)):
            q[arm[1]], q[arm[2]] = values2[j], values3[m]
            corners = placed(shapes, forward(chain, q), opening)
            spans = bounds(shapes, corners)
            for pair in range(len(shapes.pairs)):
                a, b = int(shapes.pairs[pair, 0]), int(shapes.pairs[pair, 1])
                if shapes.link[a] > arm[2] or box_gap(spans[a, 0], spans[a, 1], spans[b, 0], spans[b, 1]) > 0.0:
                    continue
                if body_distance(shapes, corners, a, b, 1e-4) <= 0.0:
                    blocked[j, m] = True
                    break
    return blocked
