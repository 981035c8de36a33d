"""The slice configuration space of the first three joints (Handey 1987 §4).

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

    `blocked` (n1, n2, n3) bool; `regions` (n1, n2, n3) numbers the free regions from 1, 0 where blocked.
    """

    step: float
    lower: NDArray
    blocked: NDArray
    regions: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "lower", frozen_array(self.lower))
        object.__setattr__(self, "blocked", frozen_array(self.blocked, bool))
        object.__setattr__(self, "regions", frozen_array(self.regions, np.int32))

    @property
    def centres(self) -> tuple[NDArray, ...]:
        """Centres [rad] of the cells of each joint."""
        return tuple(self.lower[i] + (np.arange(n) + 0.5) * self.step for i, n in enumerate(self.blocked.shape))

    def cell(self, q: NDArray) -> tuple[int, int, int]:
        """The cell that holds the first three joints of q; the nearest one when it lies beyond the last."""
        k = np.floor((np.asarray(q)[:3] - self.lower) / self.step).astype(int)
        i, j, m = np.clip(k, 0, np.array(self.blocked.shape) - 1)
        return int(i), int(j), int(m)

    def centre(self, cells: NDArray) -> NDArray:
        """Angles (..., 3) [rad] of cells (..., 3)."""
        return self.lower + (np.asarray(cells) + 0.5) * self.step


def configuration_space(
    mover: Mover, spheres: ArmSpheres, wrist: NDArray, step: float, around: NDArray | None = None
) -> ConfigurationSpace:
    """The space of a mover's arm, whose wrist is enclosed by `spheres`; `step` [rad] must divide a turn.

    Where the arm's own bodies are compared its wrist is at `wrist` (3,) [rad]. Each joint ranges within its limits, and no farther than
    `REACH` from the configurations `around` (m, joints) [rad] when they are given: beyond that it is the same arm a turn on.
    """
    robot = mover.model.world.robot
    lower, upper = np.array(robot.lower[:3]), np.array(robot.upper[:3])
    if around is not None:
        lower = lower + step * np.floor(np.maximum(around[:, :3].min(axis=0) - REACH - lower, 0.0) / step)
        upper = np.minimum(upper, around[:, :3].max(axis=0) + REACH)
    counts = np.maximum(np.floor((upper - lower) / step + 1e-9).astype(int), 1)
    turn = round(TURN / step)
    once = np.minimum(counts, turn)
    chain = mover.model.chain
    values = [lower[i] + (np.arange(once[i]) + 0.5) * step for i in range(3)]
    blocked = _blocked(mover, spheres, values, step)
    blocked |= _self_blocked(chain, mover.bodies.shapes, mover.opening, values[1], values[2], np.asarray(wrist, dtype=float))[None]
    whole = blocked[np.ix_(*(np.arange(counts[i]) % turn for i in range(3)))]
    regions = np.empty(whole.shape, np.int32)
    ndimage.label(~whole, structure=np.ones((3, 3, 3)), output=regions)
    return ConfigurationSpace(step, lower, whole, regions)


def _blocked(mover: Mover, spheres: ArmSpheres, values: list[NDArray], step: float) -> NDArray:
    """Cells (n1, n2, n3) that the scene does not leave wholly free."""
    chain, field = mover.model.chain, distance_field(mover.model.world)
    centres, radii, links = np.array(spheres.centres), spheres.radii + mover.margin, np.array(spheres.links)
    turns = np.array([forward(chain, np.array([q, 0.0, 0.0, 0.0, 0.0, 0.0][: mover.model.arm.n]))[1] for q in values[0]])
    tables = [
        _tables(chain, centres[links == 1], radii[links == 1], link_values(values, 1), step / 2),
        _tables(chain, centres[links == 2], radii[links == 2], link_values(values, 2), step / 2),
        _tables(chain, centres[links == 3], radii[links == 3], link_values(values, 3), step / 2),
    ]
    return _assemble(field, turns, tables[0], tables[1], tables[2])


def link_values(values: list[NDArray], link: int) -> tuple[NDArray, NDArray]:
    """The values of joints 2 and 3 that a link's place hangs on; a single zero for a joint beyond it."""
    zero = np.zeros(1)
    return (values[1] if link >= 2 else zero), (values[2] if link >= 3 else zero)


@njit(cache=True)
def _needed(chain: Chain, poses: NDArray, link: int, x: float, y: float, z: float, half: float) -> float:
    """How far [m] half a cell of each joint can move the point x, y, z carried by a link."""
    moved = 0.0
    for joint in range(link - 1, -1, -1):
        T, a = poses[joint + 1], chain.axes[joint]
        ax = T[0, 0] * a[0] + T[0, 1] * a[1] + T[0, 2] * a[2]
        ay = T[1, 0] * a[0] + T[1, 1] * a[1] + T[1, 2] * a[2]
        az = T[2, 0] * a[0] + T[2, 1] * a[1] + T[2, 2] * a[2]
        u, v, w = x - T[0, 3], y - T[1, 3], z - T[2, 3]
        along = u * ax + v * ay + w * az
        moved += half * (np.sqrt(max(u * u + v * v + w * w - along * along, 0.0)) + moved)
    return moved


@njit(cache=True)
def _tables(chain: Chain, centres: NDArray, radii: NDArray, values: tuple[NDArray, NDArray], half: float) -> tuple[NDArray, NDArray]:
    """Where a link's k spheres are in link 1's frame (n2, n3, k, 3), and the clearance (n2, n3, k) [m] that they need."""
    n2, n3, k = len(values[0]), len(values[1]), len(radii)
    link = 1 if n2 == 1 else (2 if n3 == 1 else 3)
    where, need = np.empty((n2, n3, k, 3)), np.empty((n2, n3, k))
    p = np.empty(3)
    for j in range(n2):
        for m in range(n3):
            poses = forward(chain, np.array([0.0, values[0][j], values[1][m]]))
            T, S = poses[link], poses[1]
            for s in range(k):
                for axis in range(3):
                    p[axis] = T[axis, 0] * centres[s, 0] + T[axis, 1] * centres[s, 1] + T[axis, 2] * centres[s, 2] + T[axis, 3]
                u, v, w = p[0] - S[0, 3], p[1] - S[1, 3], p[2] - S[2, 3]
                for axis in range(3):
                    where[j, m, s, axis] = S[0, axis] * u + S[1, axis] * v + S[2, axis] * w
                need[j, m, s] = radii[s] + _needed(chain, poses, link, p[0], p[1], p[2], half)
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
def _self_blocked(chain: Chain, shapes: Shapes, opening: float, values2: NDArray, values3: NDArray, wrist: NDArray) -> NDArray:
    """Cells (n2, n3) in whose centre, with the wrist where it is, one of the first two links or the base meets what comes after it.

    Joint 1 does not matter.
    """
    blocked = np.zeros((len(values2), len(values3)), np.bool_)
    q = np.zeros(3 + len(wrist))
    q[3:] = wrist
    for j in range(len(values2)):
        for m in range(len(values3)):
            q[1], q[2] = values2[j], values3[m]
            corners = placed(shapes, forward(chain, q), opening)
            spans = bounds(shapes, corners)
            for pair in range(len(shapes.pairs)):
                a, b = int(shapes.pairs[pair, 0]), int(shapes.pairs[pair, 1])
                if shapes.link[a] >= 3 or box_gap(spans[a, 0], spans[a, 1], spans[b, 0], spans[b, 1]) > 0.0:
                    continue
                if body_distance(shapes, corners, a, b, 1e-4) <= 0.0:
                    blocked[j, m] = True
                    break
    return blocked
