"""The independent judge of arm motion: Pinocchio's kinematics and FCL's collision, slow and fine, nothing of the planner's own."""

from itertools import pairwise

import fcl
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from handey_studio.geometry import HeightField
from handey_studio.world import Block, Held, World, arm_of, hand_hulls, load_robot
from handey_studio.world.arm import Arm

ROBOT = load_robot("robots/ur5")
DOWN = np.diag([1.0, -1.0, -1.0, 1.0])


def pile(seed: int = 0, cell: float = 0.004) -> HeightField:
    """A scanned table with a dozen boxes on it, with a sensor's noise."""
    rng = np.random.default_rng(seed)
    n = int(0.5 / cell)
    top = rng.normal(0.0, 0.0003, (n, n))
    for _ in range(12):
        i, j = rng.integers(n // 5, 2 * n // 3, 2)
        w, h = rng.integers(int(0.02 / cell), int(0.06 / cell), 2)
        top[j : j + h, i : i + w] = np.maximum(top[j : j + h, i : i + w], rng.uniform(0.02, 0.09))
    T = np.eye(4)
    T[:3, 3] = 0.25, -0.25, 0.0
    return HeightField(top, cell, T)


def scene(seed: int = 0) -> World:
    """A pile, a pillar and a shelf."""
    pillar, shelf = np.eye(4), np.eye(4)
    pillar[:3, 3], shelf[:3, 3] = (0.1, 0.45, 0.3), (0.45, -0.45, 0.35)
    return World(ROBOT, terrain=pile(seed), blocks=(Block("pillar", [0.1, 0.1, 0.6], pillar), Block("shelf", [0.4, 0.2, 0.02], shelf)))


def convex(corners: np.ndarray) -> fcl.Convex:
    hull = ConvexHull(corners)
    faces = []
    for simplex, equation in zip(hull.simplices, hull.equations, strict=True):
        a, b, c = corners[simplex]
        faces += [3, *(simplex if np.cross(b - a, c - a) @ equation[:3] > 0 else simplex[::-1])]
    return fcl.Convex(np.array(corners), len(hull.simplices), np.array(faces))


class Judge:
    """Which pairs of bodies meet at a configuration, by FCL."""

    def __init__(self, world: World, opening: float, held: Held | None = None) -> None:
        self.arm: Arm = arm_of(world.robot)
        self.model, self.data = self.arm.model, self.arm.model.createData()
        n = self.arm.n
        self.moving = [(body.name, body.link, convex(hull)) for body in self.arm.bodies for hull in body.hulls]
        self.links = len(self.moving)
        T = self.arm.T_last_hand
        for name, corners in hand_hulls(world.robot, opening).items():
            self.moving.append((name, n, convex(corners @ T[:3, :3].T + T[:3, 3])))
        for piece in held.part.pieces if held else ():
            T_last_part = T @ held.T_hand_part
            self.moving.append((held.name, n, convex(piece @ T_last_part[:3, :3].T + T_last_part[:3, 3])))
        self.objects = [fcl.CollisionObject(shape) for _, _, shape in self.moving]
        self.fixed = list(_fixed(world))
        self.manager = fcl.DynamicAABBTreeCollisionManager()
        self.manager.registerObjects([o for _, o in self.fixed])
        self.manager.setup()

    def meets(self, q: np.ndarray) -> bool:
        """Whether the arm meets the scene or itself."""
        pin.forwardKinematics(self.model, self.data, np.asarray(q))
        poses = [pin.SE3.Identity(), *list(self.data.oMi)[1:]]
        for (_, link, _), thing in zip(self.moving, self.objects, strict=True):
            thing.setTransform(fcl.Transform(poses[link].rotation, poses[link].translation))
        for (_, link, _), thing in zip(self.moving, self.objects, strict=True):
            data = fcl.CollisionData()
            if link > 0:
                self.manager.collide(thing, data, fcl.defaultCollisionCallback)
                if data.result.is_collision:
                    return True
        return any(
            fcl.collide(self.objects[a], self.objects[b], fcl.CollisionRequest(), fcl.CollisionResult())
            for a in range(len(self.moving))
            for b in range(len(self.moving))
            if self.moving[b][1] - self.moving[a][1] > (1 if b < self.links else 0)
        )

    def first_meeting(self, path: np.ndarray, step: float = 0.002) -> float | None:
        """The first place of a joint-linear path, looked at every `step` [rad], where the arm meets anything."""
        for k, (a, b) in enumerate(pairwise(path)):
            for t in np.linspace(0.0, 1.0, 2 + int(np.abs(b - a).max() / step)):
                if self.meets(a + t * (b - a)):
                    return k + t
        return None


def _fixed(world: World):
    slab = fcl.CollisionObject(fcl.Box(10, 10, 1), fcl.Transform(np.array([0, 0, world.table_z - 0.5])))
    yield "table", slab
    for block in world.blocks:
        T = block.T_world_block
        yield block.name, fcl.CollisionObject(fcl.Box(*block.size), fcl.Transform(T[:3, :3], T[:3, 3]))
    for placed in world.parts:
        for piece in placed.part.pieces:
            yield placed.name, fcl.CollisionObject(convex(piece), fcl.Transform(placed.T_world_part[:3, :3], placed.T_world_part[:3, 3]))
    if world.terrain is not None:
        field = world.terrain
        for j, i in np.argwhere(field.top > world.table_z + 0.002):
            centre = field.T_world_range[:3, 3] + [(i + 0.5) * field.cell, (j + 0.5) * field.cell, field.top[j, i] / 2]
            yield "depth map", fcl.CollisionObject(fcl.Box(field.cell, field.cell, field.top[j, i]), fcl.Transform(centre))


def reach(model, rng: np.random.Generator, opening: float = 0.05) -> np.ndarray:
    """A free configuration with the hand pointing down somewhere above the pile."""
    arm = model.arm
    while True:
        turn, T = rng.uniform(-np.pi, np.pi), DOWN.copy()
        T[:2, :2] = np.array([[np.cos(turn), np.sin(turn)], [np.sin(turn), -np.cos(turn)]])
        T[:3, 3] = rng.uniform(0.3, 0.65), rng.uniform(-0.25, 0.25), rng.uniform(0.02, 0.25)
        branches = [q for q in arm.nearest_turns(arm.ik(T), arm.robot.home) if model.in_contact(q, opening, margin=0.002) is None]
        if branches:
            return branches[int(rng.integers(len(branches)))]
