"""Whether a grip holds (Handey 1987 §5, after the idea of Barber et al. 1986): the pads' forces against the part's weight, turned any way.

Each finger presses with the hand's force, spread evenly where its pad touches, so that both press against each other. What friction gives
then in the pads' plane is a convex set of forces across the closing direction and torques about it: the sum of a disc for each bit of a
pad (its limit surface). A pressure that moves towards a corner of the pads carries what tips the part over or pushes it along the
closing direction; the share of the force that this takes is taken away from friction. So for a grip that is said to hold there is a
spread of pressure and friction that balances the weight.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from handey_studio.base import Value, frozen_array
from handey_studio.geometry.transforms import inverse
from handey_studio.grasping.classes import GraspClass, evenly, finger_pads
from handey_studio.world import Hand, Part

GRAVITY_M_S2 = 9.80665
LEAST_REACH_M = 1e-4  # a patch is taken for at least this large where torques are scaled by its size

Limit = Literal["slips", "turns", "tips over", "touches nothing"]


@dataclass(frozen=True)
class GripOptions:
    """`bits` that each pad's patch is cut into, and `directions` in which the set of friction's forces and torques is looked up."""

    bits: int = 120
    directions: int = 200


@dataclass(frozen=True, eq=False)
class PadWrenches(Value):
    """What the pads can do to the part, about their centre, in the hand's frame.

    `slip` (m, 3) and `tip` (k, 3) are planes: friction gives a force y, z [N] and a torque x [N m] within slip · (fy, fz, τx) ≤ 1, moved
    pressure gives fx and τy, τz within tip · (fx, τy, τz) ≤ 1, and both together while the two greatest products add up to at most 1.
    `patches` are the pads' outlines on the part in y, z [m] of the hand. `weight` [N] and `lever` (3,) [m] from the pads' centre to the
    part's centre of mass. Nothing touched: no planes.
    """

    slip: NDArray
    tip: NDArray
    patches: tuple[BaseGeometry, BaseGeometry]
    weight: float
    lever: NDArray
    force: float

    def __post_init__(self) -> None:
        for key in ("slip", "tip", "lever"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))


@dataclass(frozen=True)
class Grip:
    """How well a grip holds at the worst of some directions of gravity.

    `force_margin` [N] and `torque_margin` [N m]: so much more, in any direction, the grip would hold; negative if it does not hold the
    weight. `worst` is the direction of gravity in the hand's frame, `limit` what would happen first there, and `needed_force` [N] the
    finger force that would just hold.
    """

    force_margin: float
    torque_margin: float
    worst: tuple[float, float, float]
    limit: Limit
    needed_force: float

    @property
    def holds(self) -> bool:
        return self.force_margin >= 0.0 and self.torque_margin >= 0.0


def gravity_in_hand(Ts_world_hand: NDArray) -> NDArray:
    """Directions of gravity (n, 3) in the hand's frame along hand poses (n, 4, 4)."""
    return -Ts_world_hand[:, 2, :3]


def grip_margin(wrenches: PadWrenches, down_hand: NDArray) -> Grip:
    """How well the pads hold the part at the worst of the directions of gravity (n, 3), unit vectors in the hand's frame."""
    if not len(wrenches.slip):
        worst = down_hand[0]
        lever = float(np.linalg.norm(wrenches.lever))
        return Grip(-wrenches.weight, -wrenches.weight * lever, _plain(worst), "touches nothing", np.inf)
    force = -wrenches.weight * down_hand  # what the pads must give
    torque = np.cross(wrenches.lever, force)
    across, along = np.c_[force[:, 1:], torque[:, :1]], np.c_[force[:, :1], torque[:, 1:]]
    slips, tips = wrenches.slip @ across.T, wrenches.tip @ along.T
    pulls = np.hypot(wrenches.slip[:, 0], wrenches.slip[:, 1]), np.abs(wrenches.slip[:, 2])
    pushes = np.abs(wrenches.tip[:, 0]), np.hypot(wrenches.tip[:, 1], wrenches.tip[:, 2])
    margins = [float(_least_margin(slips, tips, pull, push)) for pull, push in zip(pulls, pushes, strict=True)]
    used = slips.max(axis=0) + tips.max(axis=0)
    k = int(np.argmax(used))
    shares: dict[Limit, float] = {
        "slips": float((wrenches.slip[:, :2] @ across[k, :2]).max()),
        "turns": float((wrenches.slip[:, 2] * across[k, 2]).max()),
        "tips over": float(tips[:, k].max()),
    }
    limit = max(shares, key=lambda name: shares[name])
    return Grip(margins[0], margins[1], _plain(down_hand[k]), limit, float(wrenches.force * used[k]))


@njit(cache=True)
def _least_margin(slips: NDArray, tips: NDArray, pulls: NDArray, pushes: NDArray) -> float:
    """How much more reaches the nearest plane: slips (m, n) and tips (k, n) are used up, a unit more uses pulls (m,) and pushes (k,)."""
    least = np.inf
    for i in range(len(slips)):
        for j in range(len(tips)):
            left, each = np.inf, np.sqrt(pulls[i] ** 2 + pushes[j] ** 2)
            for d in range(slips.shape[1]):
                left = min(left, 1.0 - slips[i, d] - tips[j, d])
            least = min(least, left / each)
    return least


@lru_cache(maxsize=512)
def pad_wrenches(
    grasp_class: GraspClass, part: Part, hand: Hand, T_hand_part: tuple[float, ...], options: GripOptions = GripOptions()
) -> PadWrenches:
    """What the pads can do to a part that is held at T_hand_part (its 16 numbers, row by row), the closing direction along the hand's x."""
    T = np.array(T_hand_part).reshape(4, 4)
    patches = pad_patches(grasp_class, hand, T)
    weight = GRAVITY_M_S2 * part.mass
    com = T[:3, :3] @ part.solid.volume_and_centroid[1] + T[:3, 3]
    if max(patch.area for patch in patches) <= 0.0 or any(patch.is_empty for patch in patches):
        return PadWrenches(np.empty((0, 3)), np.empty((0, 3)), patches, weight, com, hand.force)
    centre = shapely.get_coordinates(patches[0].centroid)[0]
    bits = [_bits(patch, options.bits) - centre for patch in patches]
    grip = part.friction * hand.pad_friction * hand.force
    slip = _slip_planes([(bit, grip / len(bit)) for bit in bits], options.directions)
    corners = [shapely.get_coordinates(patch.convex_hull) - centre for patch in patches]
    tip = _tip_planes(corners, 2.0 * hand.force)
    return PadWrenches(slip, tip, patches, weight, com - np.r_[0.0, centre], hand.force)


def pad_patches(grasp_class: GraspClass, hand: Hand, T_hand_part: NDArray) -> tuple[BaseGeometry, BaseGeometry]:
    """Where the fingers at positive and at negative x press, in y, z [m] of the hand.

    Of two faces it is what both pads cover of both; opposite an edge or a vertex what the pad covers of the face evenly around that.
    """
    T_plane_hand = inverse(T_hand_part @ grasp_class.T_part_plane)
    along = T_plane_hand[1:3, 2]
    pad = finger_pads(hand, T_plane_hand[None, 1:3, 3], np.array([np.arctan2(along[1], along[0])]))[0]
    shared = pad.intersection(grasp_class.contact)
    face = shared
    if grasp_class.kind != "faces" and not shared.is_empty:
        face = evenly(np.array([pad.intersection(grasp_class.surfaces[0])]), np.array([shared]))[0]
    T_hand_plane = T_hand_part @ grasp_class.T_part_plane
    matrix = (*T_hand_plane[1, 1:3], *T_hand_plane[2, 1:3], *T_hand_plane[1:3, 3])
    seen = [affinity.affine_transform(patch, matrix) for patch in (face, shared)]
    return (seen[0], seen[1]) if T_hand_plane[0, 0] > 0 else (seen[1], seen[0])


def _bits(patch: BaseGeometry, count: int) -> NDArray:
    """Points (k, 2) [m] all over a patch, about `count` over a polygon, whose middle is the patch's."""
    middle = shapely.get_coordinates(patch.centroid)[0]
    if patch.area <= 0.0:
        lines = [np.linspace(ends[0], ends[-1], 21) for ends in map(shapely.get_coordinates, shapely.get_parts(patch))]
        points = np.concatenate(lines)
    else:
        step = np.sqrt(patch.area / count)
        y0, z0, y1, z1 = patch.bounds
        y, z = (np.linspace(a, b, max(2, round((b - a) / step)) * 2 + 1)[1::2] for a, b in ((y0, y1), (z0, z1)))
        points = np.stack(np.meshgrid(y, z), axis=-1).reshape(-1, 2)
        points = points[shapely.contains_xy(patch, points[:, 0], points[:, 1])]
    return points + (middle - points.mean(axis=0)) if len(points) else middle[None]


def _slip_planes(pads: list[tuple[NDArray, float]], directions: int) -> NDArray:
    """Planes (m, 3) within which friction's (fy, fz, τx) lie: the hull of points on the boundary of the sum of all bits' discs."""
    reach = max(LEAST_REACH_M, max(float(np.linalg.norm(points, axis=1).max()) for points, _ in pads))
    u = _sphere(directions) / (1.0, 1.0, reach)
    boundary = np.zeros((len(u), 3))
    for points, most in pads:
        pull = u[:, None, :2] + u[:, 2, None, None] * np.c_[-points[:, 1], points[:, 0]]
        force = most * pull / np.maximum(np.linalg.norm(pull, axis=2, keepdims=True), 1e-12)
        torque = points[:, 0] * force[..., 1] - points[:, 1] * force[..., 0]
        boundary += np.c_[force.sum(axis=1), torque.sum(axis=1)]
    return _planes(boundary, np.array([1.0, 1.0, reach]))


def _tip_planes(corners: list[NDArray], force: float) -> NDArray:
    """Planes (k, 3) within which (fx, τy, τz) lie that the fingers give when their whole force [N] may press anywhere on the pads."""
    reach = max(LEAST_REACH_M, max(float(np.linalg.norm(points, axis=1).max()) for points in corners))
    pushes = [side * force * np.c_[np.ones(len(p)), p[:, 1], -p[:, 0]] for side, p in zip((-1.0, 1.0), corners, strict=True)]
    return _planes(np.concatenate(pushes), np.array([1.0, reach, reach]))


def _planes(points: NDArray, scale: NDArray) -> NDArray:
    """Planes (m, 3) with plane · x ≤ 1 on the hull of points (n, 3) around the origin; `scale` (3,) makes their axes alike."""
    hull = ConvexHull(points / scale)
    planes = np.unique(np.round(hull.equations / -hull.equations[:, 3:], 9), axis=0)
    return planes[:, :3] / scale


def _sphere(count: int) -> NDArray:
    """Unit vectors (count + 6, 3): those along the axes, and others spread evenly over the sphere."""
    k = np.arange(count) + 0.5
    height, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    ring = np.sqrt(1.0 - height**2)
    return np.concatenate([np.eye(3), -np.eye(3), np.c_[ring * np.cos(turn), ring * np.sin(turn), height]])


def _plain(v: NDArray) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])
