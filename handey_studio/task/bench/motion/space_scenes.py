"""Random scenes to build configuration spaces in: a scanned pile, known parts about it, a pillar; and one part stands elsewhere later."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.geometry import HeightField, box
from handey_studio.geometry.transforms import from_xyz_rpy, transform
from handey_studio.world import Block, Part, PlacedPart, Robot, World, arm_of
from handey_studio.world.collision import CollisionModel, collision_model

MAP_M = 0.40  # side of the scanned square
CELL_M = 0.001
NOISE_M = 0.0003
HAND_DOWN = np.diag([1.0, -1.0, -1.0, 1.0])
FREE_M = 0.003  # clearance of the configurations that are asked for
TRIES = 3000
PARTS = 4


@dataclass(frozen=True, eq=False)
class SpaceScene(Value):
    """A world, the same with one part elsewhere, the fingers' opening [m], and two free configurations (joints,) [rad] above the pile."""

    world: World
    moved: World
    opening: float
    start: NDArray
    goal: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen_array(self.start))
        object.__setattr__(self, "goal", frozen_array(self.goal))


def space_scene(robot: Robot, seed: int, cell: float = CELL_M) -> SpaceScene:
    """The scene of a seed, with a depth map of cells `cell` [m] wide. Raises BadInput when the robot reaches nowhere above it."""
    rng = np.random.default_rng(seed)
    middle = middle_of(robot, rng)
    T_world_map = transform(None, (middle[0] - MAP_M / 2, middle[1] - MAP_M / 2, 0.0))
    pillar = Block("pillar", np.array([0.08, 0.08, 0.5]), transform(None, (*(middle + beside(middle, 0.32)), 0.25)))
    parts = tuple(_standing(k, middle, rng) for k in range(PARTS))
    world = World(robot, blocks=(pillar,), parts=parts, terrain=_pile(T_world_map, cell, rng))
    moved = world.with_part(PlacedPart(parts[-1].name, parts[-1].part, _standing(PARTS - 1, middle, rng).T_world_part))
    opening = robot.hand.opening_max / 2
    start, goal = (free_reach(collision_model(world), middle, opening, rng) for _ in range(2))
    return SpaceScene(world, moved, opening, start, arm_of(robot).nearest_turns(goal, start))


def middle_of(robot: Robot, rng: np.random.Generator) -> NDArray:
    """Where (2,) [m] a pile lies: beside the robot, at half of what it reaches."""
    far = 0.5 * float(np.linalg.norm(arm_of(robot).T_links[1:, :3, 3], axis=1).sum())
    turn = rng.uniform(-np.pi, np.pi)
    return robot.T_world_base[:2, 3] + min(far, 0.5) * np.array([np.cos(turn), np.sin(turn)])


def beside(middle: NDArray, far: float) -> NDArray:
    """An offset (2,) [m] across the way from the robot to the pile."""
    return far * np.array([-middle[1], middle[0]]) / np.linalg.norm(middle)


def _pile(T_world_map: NDArray, cell: float, rng: np.random.Generator) -> HeightField:
    """A scanned table with a dozen boxes on it, with a sensor's noise."""
    n = round(MAP_M / cell)
    top = rng.normal(0.0, NOISE_M, (n, n))
    for _ in range(12):
        i, j = (rng.uniform(0.1, 0.8, 2) * n).astype(int)
        w, h = (rng.uniform(0.02, 0.06, 2) / cell).astype(int)
        top[j : j + h, i : i + w] = np.maximum(top[j : j + h, i : i + w], rng.uniform(0.02, 0.09))
    return HeightField(top, cell, T_world_map)


def _standing(number: int, middle: NDArray, rng: np.random.Generator) -> PlacedPart:
    """A cuboid somewhere on the pile."""
    size = np.array([0.03, 0.05, 0.04]) + 0.01 * number
    place = (*(middle + rng.uniform(-0.2, 0.2, 2)), size[2] / 2 + rng.uniform(0.0, 0.06))
    return PlacedPart(f"brick#{number}", Part(f"brick {number}", box(size)), from_xyz_rpy(place, (0, 0, rng.uniform(-np.pi, np.pi))))


def free_reach(model: CollisionModel, middle: NDArray, opening: float, rng: np.random.Generator) -> NDArray:
    """A free configuration with the hand pointing down somewhere above the pile. Raises BadInput when none was found."""
    arm, robot = model.arm, model.world.robot
    for _ in range(TRIES):
        place = (*(middle + rng.uniform(-0.2, 0.2, 2)), rng.uniform(0.02, 0.25))
        T = transform(None, place) @ from_xyz_rpy((0, 0, 0), (0, 0, rng.uniform(-np.pi, np.pi))) @ HAND_DOWN
        branches = arm.nearest_turns(arm.ik(T), robot.home)
        for q in rng.permutation(branches) if len(branches) else ():
            if robot.limit_margin(q) > 0.02 and model.in_contact(q, opening, margin=FREE_M) is None:
                return q
    raise BadInput(f'robot "{robot.name}" found no free reach above a random pile in {TRIES} tries.')
