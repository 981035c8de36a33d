"""Compiling ahead: the first use of the compiled queries on a machine takes half a minute, which nobody should wait for at MOVE."""

import numpy as np

from handey_studio.geometry import HeightField, box
from handey_studio.geometry.transforms import transform
from handey_studio.motion.path import plan_path
from handey_studio.motion.query import PathOptions
from handey_studio.world import FINGERS, Part, PlacedPart, Robot, World
from handey_studio.world.collision import collision_model

BESIDE = (1.1, 1.1, 0.0)  # where the table's corner is bare of the arm


def warm_up(robot: Robot) -> None:
    """Compiles, or loads from the cache, all that collision and arm motion use: plans a small motion with a part and a map far beside."""
    T = transform(None, BESIDE)
    world = World(robot, parts=(PlacedPart("part", Part("part", box([0.02] * 3)), T),), terrain=HeightField(np.full((4, 4), 0.01), 0.01, T))
    model = collision_model(world)
    pairs = [(finger, "table") for finger in FINGERS]
    model.hand_contact(np.eye(4), robot.hand.opening_max, None, pairs)
    step = np.where(robot.upper - robot.home > 0.1, 0.05, -0.05)
    plan_path(world, robot.home, robot.home + step, robot.hand.opening_max, allowed_goal=pairs, options=PathOptions(straight=False))
