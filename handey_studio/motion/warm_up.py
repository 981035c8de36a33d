"""Compiling ahead: the first use of the compiled queries on a machine takes half a minute, which nobody should wait for at MOVE."""

import numpy as np

from handey_studio.motion.path import plan_path
from handey_studio.motion.query import PathOptions
from handey_studio.world import FINGERS, Robot, World
from handey_studio.world.collision import collision_model


def warm_up(robot: Robot) -> None:
    """Compiles, or loads from the cache, all that collision and arm motion use, by planning a small motion above a bare table."""
    world = World(robot)
    model = collision_model(world)
    pairs = [(finger, "table") for finger in FINGERS]
    model.hand_contact(np.eye(4), robot.hand.opening_max, None, pairs)
    step = np.where(robot.upper - robot.home > 0.1, 0.05, -0.05)
    plan_path(world, robot.home, robot.home + step, robot.hand.opening_max, allowed_goal=pairs, options=PathOptions(straight=False))
