"""Random deep reaches: a held part is carried from above into a bin or down among a pile, as far as the hand fits."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy, transform
from handey_studio.task.bench.motion.problems import Problem
from handey_studio.world import Block, Held, Part, Robot, World, arm_of
from handey_studio.world.collision import CollisionModel, collision_model

HELD = "held"
DOWN = np.diag([1.0, -1.0, -1.0, 1.0])
RING_M = (0.40, 0.60)  # how far from the robot's axis the middle of the pile may be
FLOOR_M = (0.30, 0.22)  # the bin's inner sides, and where the pile lies without one
WALL_M = 0.012
DEEP_M = 0.15  # the fingertips' height at the goal is below this
LOWER_M = 0.01  # steps down to the goal
FREE_M = 0.003  # clearance at both ends
SCENES = 30  # for one problem
TRIES = 60  # poses for a goal or a start before another scene is made


def random_reaches(robot: Robot, seeds: range) -> Iterator[Problem]:
    """One problem a seed: bins and piles in turn. Raises BadInput when the robot cannot reach into any."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        tried = (_reach(robot, rng, seed) for _ in range(SCENES))
        problem = next((found for found in tried if found is not None), None)
        if problem is None:
            raise BadInput(
                f'robot "{robot.name}" reached into none of {SCENES} random scenes {RING_M[0]:g} to {RING_M[1]:g} m from its axis.'
            )
        yield problem


def _reach(robot: Robot, rng: np.random.Generator, seed: int) -> Problem | None:
    """A problem in a new scene; None when no goal or no start was found in it."""
    family = ("bin", "pile")[seed % 2]
    turn, far = rng.uniform(-np.pi, np.pi), rng.uniform(*RING_M)
    T_world_pile = robot.T_world_base @ from_xyz_rpy((far * np.cos(turn), far * np.sin(turn), 0.0), (0, 0, rng.uniform(-np.pi, np.pi)))
    T_world_pile[2, 3] = 0.0
    blocks = _pile(T_world_pile, rng) + (_walls(T_world_pile, rng.uniform(0.12, 0.20)) if family == "bin" else ())
    width = rng.uniform(0.02, 0.05)
    part = Part(HELD, box((width, rng.uniform(0.03, 0.06), rng.uniform(0.05, 0.10))))
    held = Held(HELD, part, transform(None, (0.0, 0.0, rng.uniform(0.0, 0.02))))
    world = World(robot, blocks=blocks)
    model = collision_model(world)
    goal = _lowest(model, T_world_pile, width, held, rng)
    start = _above(model, width, held, rng) if goal is not None else None
    if start is None or goal is None:
        return None
    goal = arm_of(robot).nearest_turns(goal, start)
    return Problem(family, f"{seed:04d}", world, start, goal, width, held)


def _pile(T_world_pile: NDArray, rng: np.random.Generator) -> tuple[Block, ...]:
    """Boxes that stand on the floor or on those before them, turned about the vertical."""
    blocks: list[Block] = []
    tops: list[tuple[NDArray, float, float]] = []
    for k in range(int(rng.integers(8, 16))):
        size = rng.uniform((0.03, 0.03, 0.02), (0.10, 0.07, 0.08))
        reach = float(np.hypot(*size[:2])) / 2
        spot = rng.uniform(-0.5, 0.5, 2) * np.maximum(np.array(FLOOR_M) - 2 * reach, 0.0)
        under = [top for place, radius, top in tops if np.linalg.norm(place - spot) < radius + reach]
        bottom = max(under, default=0.0)
        T = T_world_pile @ from_xyz_rpy((*spot, bottom + size[2] / 2), (0, 0, rng.uniform(-np.pi, np.pi)))
        blocks.append(Block(f"box {k}", size, T))
        tops.append((spot, reach, bottom + float(size[2])))
    return tuple(blocks)


def _walls(T_world_pile: NDArray, height: float) -> tuple[Block, ...]:
    x, y = FLOOR_M
    sides = (
        ("wall x-", (WALL_M, y + 2 * WALL_M, height), (-(x + WALL_M) / 2, 0.0)),
        ("wall x+", (WALL_M, y + 2 * WALL_M, height), ((x + WALL_M) / 2, 0.0)),
        ("wall y-", (x, WALL_M, height), (0.0, -(y + WALL_M) / 2)),
        ("wall y+", (x, WALL_M, height), (0.0, (y + WALL_M) / 2)),
    )
    return tuple(Block(name, np.array(size), T_world_pile @ transform(None, (*spot, height / 2))) for name, size, spot in sides)


def _lowest(model: CollisionModel, T_world_pile: NDArray, opening: float, held: Held, rng: np.random.Generator) -> NDArray | None:
    """A free configuration with the hand as deep in the pile as a way straight down leads; None when none was found."""
    for _ in range(TRIES):
        spot = rng.uniform(-0.4, 0.4, 2) * FLOOR_M
        T = (
            T_world_pile
            @ transform(None, (*spot, 0.35))
            @ DOWN
            @ from_xyz_rpy((0, 0, 0), (*rng.normal(0.0, 0.15, 2), rng.uniform(-np.pi, np.pi)))
        )
        lowest = None
        while T[2, 3] > 0.0:
            at = _free_branch(model, T, opening, held, rng)
            if at is None:
                break
            lowest = at
            T = transform(None, (0.0, 0.0, -LOWER_M)) @ T
        if lowest is not None and T[2, 3] < DEEP_M:
            return lowest
    return None


def _free_branch(model: CollisionModel, T_world_hand: NDArray, opening: float, held: Held, rng: np.random.Generator) -> NDArray | None:
    robot = model.world.robot
    branches = model.arm.nearest_turns(model.arm.ik(T_world_hand), np.zeros(model.arm.n))
    for q in rng.permutation(branches) if len(branches) else ():
        if robot.limit_margin(q) > 0 and model.in_contact(q, opening, held, margin=FREE_M) is None:
            return q
    return None


def _above(model: CollisionModel, opening: float, held: Held, rng: np.random.Generator) -> NDArray | None:
    """A free configuration anywhere, each joint within half a turn of its middle; None when none was found."""
    robot = model.world.robot
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    for _ in range(TRIES):
        q = rng.uniform(low, high)
        if model.in_contact(q, opening, held, margin=FREE_M) is None:
            return q
    return None
