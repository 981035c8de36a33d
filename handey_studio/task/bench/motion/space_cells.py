"""The naive oracle of configuration spaces: exact meshes and FCL, inside cells that are called free, looked at finely."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Progress
from handey_studio.cell.check.path_check import path_contacts
from handey_studio.motion.certificate import mover
from handey_studio.motion.configuration_space import ConfigurationSpace, configuration_space, extent_around
from handey_studio.task.bench.motion.space_scenes import space_scene
from handey_studio.world import ConvexBody, Robot, World, arm_of
from handey_studio.world.collision_bodies import columns_of

MAP_CELL_M = 0.01  # few columns, each an exact body to the checker
LOOKS = 8  # configurations in each cell: its corners' and inner ones, at places of the wrist's way drawn at random
TURN_RAD = 0.6  # how far at most each joint of the wrist turns


def check_cells(robot: Robot, seeds: range, cells: int, tell: Callable[[str], None], progress: Progress) -> dict[str, Any]:
    """Random free cells over the scenes of some seeds, at 5° and 2.5° in turn: how many hold a posture that meets the scene.

    The arm against itself is not asked for: its spaces look at that in the cells' centres only, and leave the rest to the certificate.
    """
    looked = colliding = 0
    each = -(-cells // len(seeds))
    for number, seed in enumerate(seeds):
        if progress.cancelled:
            break
        progress.report(number / len(seeds), f"free cells of scene {seed}")
        found = _scene(robot, seed, min(each, cells - looked))
        looked, colliding = looked + found[0], colliding + found[1]
    tell(f"{looked} free cells, {LOOKS} looks each: {colliding} collide with the scene")
    return {"cells": looked, "looks": LOOKS, "colliding": colliding}


def _scene(robot: Robot, seed: int, count: int) -> tuple[int, int]:
    """Cells looked at, and those that collide with the scene."""
    scene, rng = space_scene(robot, seed, MAP_CELL_M), np.random.default_rng(seed)
    others = robot.other_index
    turned = np.clip(scene.start[others] + rng.uniform(-TURN_RAD, TURN_RAD, len(others)), robot.lower[others], robot.upper[others])
    held = np.isin(others, robot.held_index)
    turned[held] = scene.start[others][held]
    way = np.array([scene.start[others], turned])
    step = float(np.deg2rad((5.0, 2.5)[seed % 2]))
    space, _ = configuration_space(mover(scene.world, scene.opening), way, extent_around(robot, step, scene.start[None]))
    free = np.argwhere(~space.blocked)
    if not len(free):
        return 0, 0
    chosen = free[rng.integers(len(free), size=count)]
    q = np.concatenate([_looks(space, cell, way, scene.start, others, rng) for cell in chosen])
    bodies, exact = {body.name for body in arm_of(robot).bodies} | set(robot.hand.boxes(0.0)), columns_as_bodies(scene.world)
    hits = [hit for hit in path_contacts(exact, q, scene.opening, step_rad=np.inf) if not set(hit.bodies) <= bodies]
    return len(chosen), len({round(hit.time) // LOOKS for hit in hits})


def _looks(space: ConfigurationSpace, cell: NDArray, way: NDArray, q: NDArray, others: NDArray, rng: np.random.Generator) -> NDArray:
    """Configurations (LOOKS, n) in a cell: half of them in its corners, the others anywhere, the wrist anywhere on its way."""
    offsets = rng.uniform(-0.5, 0.5, (LOOKS, 3))
    offsets[::2] = np.sign(offsets[::2]) / 2
    looks = np.repeat(q[None], LOOKS, axis=0)
    looks[:, space.joints] = space.centre(cell) + offsets * space.extent.step
    looks[:, others] = way[0] + rng.random((LOOKS, 1)) * (way[1] - way[0])
    return looks


def columns_as_bodies(world: World) -> World:
    """The world with its depth map's columns as bodies, for the exact checker."""
    columns = columns_of(world.terrain, world.table_z, float(world.free_space[1, 2]))
    bodies = tuple(ConvexBody(f"column {k}", corners) for k, corners in enumerate(columns))
    return replace(world, blocks=(*world.blocks, *bodies), terrain=None)
