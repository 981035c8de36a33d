"""Which bodies meet along a sampled motion of the arm in the true scene, and how deep."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.check.shapes import Shape, body_shape, box_shape, depth, link_shape
from handey_studio.geometry.transforms import inverse, transform
from handey_studio.world.arm import Arm, arm_of, hand_hulls
from handey_studio.world.robot import Robot

FINGER_SIDES = {"finger_left": -0.5, "finger_right": 0.5}  # how much of the opening each moves along the hand's x


class Depths(Protocol):
    """How deep allowed and other pairs may meet [m]."""

    @property
    def allowed_depth(self) -> float: ...
    @property
    def free_depth(self) -> float: ...


@dataclass(frozen=True)
class Sampled:
    """A motion at many instants: `time` (k,) [s], `q` (k, joints) [rad], `opening` (k,) [m]."""

    time: NDArray
    q: NDArray
    opening: NDArray


@dataclass(frozen=True)
class Contact:
    """The deepest instant at which two bodies meet beyond their limit."""

    bodies: tuple[str, str]
    time: float
    depth: float
    limit: float
    allowed: bool


@dataclass(frozen=True)
class Scene:
    """The arm's shapes by link, the true bodies with their shapes and the plan's names for them, and what the hand holds.

    The hand's boxes, drawn with closed fingers, count as one link more than the arm has.
    """

    links: tuple[tuple[Shape, int], ...]
    bodies: list[SolidBody]
    names: dict[str, str]
    shapes: dict[str, Shape]
    held: SolidBody | None = None
    T_hand_body: NDArray | None = None

    def holding(self, body: SolidBody, T_hand_body: NDArray) -> "Scene":
        """The scene with one body in the hand."""
        others = [other for other in self.bodies if other.name != body.name]
        return replace(self, bodies=others, held=body, T_hand_body=T_hand_body)

    def released(self, T_world_hand: NDArray) -> "Scene":
        """The scene with the held body left where the hand has it."""
        if self.held is None or self.T_hand_body is None:
            return self
        body = self.held.at(T_world_hand @ self.T_hand_body)
        return replace(self, bodies=[*self.bodies, body], held=None, T_hand_body=None)


def true_scene(robot: Robot, bodies: Sequence[SolidBody], names: dict[str, str]) -> Scene:
    """The scene before the first step, with nothing in the hand. `names` maps every body's true name to the plan's."""
    arm = arm_of(robot)
    hand = [box_shape(name, corners) for name, corners in hand_hulls(robot, 0.0).items()]
    links = [(link_shape(body), body.link) for body in arm.bodies] + [(shape, arm.n + 1) for shape in hand]
    return Scene(tuple(links), list(bodies), names, {body.name: body_shape(names[body.name], body) for body in bodies})


@dataclass(frozen=True)
class Mover:
    """A shape that moves with a link: its poses (k, 4, 4), and the axis-aligned boxes around it, corners (k, 3)."""

    shape: Shape
    link: int
    poses: NDArray
    low: NDArray
    high: NDArray


def mover(shape: Shape, link: int, poses: NDArray) -> Mover:
    return Mover(shape, link, poses, *shape.extents(poses))


def contacts(scene: Scene, arm: Arm, sampled: Sampled, allowed: frozenset[frozenset[str]], depths: Depths) -> list[Contact]:
    """All pairs that meet deeper than they may, each at its deepest. Neighbouring links are not looked at, nor what stands still."""
    found = []
    for a, b, instants in _pairs(scene, arm, sampled):
        names = (a.shape.name, b.shape.name)
        may = frozenset(names) in allowed
        limit = depths.allowed_depth if may else depths.free_depth
        worst, when = deepest(a, b, instants, limit)
        if when >= 0:
            found.append(Contact(names, float(sampled.time[when]), worst, limit, may))
    return found


def deepest(a: Mover, b: Mover, instants: NDArray, limit: float) -> tuple[float, int]:
    """How deep [m] two shapes meet at the instant when they do so most, and its number; `limit` and -1 when they never exceed it."""
    worst, when = limit, -1
    for k in instants:
        deep = depth(a.shape, a.poses[k], b.shape, b.poses[k])
        if deep > worst:
            worst, when = deep, int(k)
    return worst, when


def _pairs(scene: Scene, arm: Arm, sampled: Sampled) -> Iterator[tuple[Mover, Mover, NDArray]]:
    """Pairs of shapes, and the instants at which they may meet."""
    movers = _movers(scene, arm, sampled)
    in_hand = scene.shapes[scene.held.name] if scene.held is not None else None
    for i, a in enumerate(movers):
        for b in movers[i + 1 :]:
            if abs(a.link - b.link) > 1:
                yield a, b, near(a, b)
            elif a.link == b.link and b.shape is in_hand:
                # In the hand only the fingers' opening changes where they meet the held body.
                yield a, b, np.unique(sampled.opening, return_index=True)[1]
    for body in scene.bodies:
        standing = mover(scene.shapes[body.name], 0, body.T_world_body[None])
        standing = replace(standing, poses=np.broadcast_to(body.T_world_body, (len(sampled.time), 4, 4)))
        for a in movers:
            if a.link > 0:
                yield a, standing, near(a, standing)


def _movers(scene: Scene, arm: Arm, sampled: Sampled) -> list[Mover]:
    links = arm.link_poses(sampled.q)
    T_hand = arm.hand_pose(sampled.q)
    movers = []
    for shape, link in scene.links:
        poses = T_hand if link > arm.n else links[:, link]
        if shape.name in FINGER_SIDES:
            shifts = np.array([transform(None, (FINGER_SIDES[shape.name] * opening, 0.0, 0.0)) for opening in sampled.opening])
            poses = poses @ shifts
        movers.append(mover(shape, link, poses))
    if scene.held is not None and scene.T_hand_body is not None:
        movers.append(mover(scene.shapes[scene.held.name], arm.n + 1, T_hand @ scene.T_hand_body))
    return movers


def near(a: Mover, b: Mover) -> NDArray:
    """The instants at which the boxes around two shapes meet, and no face of either parts it from the other's box."""
    instants = np.nonzero(((a.low <= b.high) & (b.low <= a.high)).all(axis=1))[0]
    instants = instants[~_parted(a, b, instants)]
    return instants[~_parted(b, a, instants)]


def _parted(a: Mover, b: Mover, instants: NDArray) -> NDArray:
    """Whether (k,), at each of the instants, one of b's planes has all of the box around a on its outer side."""
    T_b_a = inverse(b.poses[instants]) @ a.poses[instants]
    middle, half = a.shape.bounds.mean(axis=0), np.ptp(a.shape.bounds, axis=0) / 2
    normals, offsets = b.shape.planes[:, :3], b.shape.planes[:, 3]
    centres = T_b_a[:, :3, :3] @ middle + T_b_a[:, :3, 3]
    reach = np.abs(normals @ T_b_a[:, :3, :3]) @ half
    return (centres @ normals.T + offsets > reach).any(axis=1)
