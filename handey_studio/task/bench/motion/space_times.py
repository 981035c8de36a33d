"""How long configuration spaces take: from a new depth map, when one part moved, and to ask for a path in one that is there."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Progress
from handey_studio.geometry import HeightField
from handey_studio.geometry.transforms import transform
from handey_studio.motion import PathOptions, plan_path, time_path, warm_up
from handey_studio.motion.layers import Layers, layers_of
from handey_studio.motion.query import Query, query
from handey_studio.motion.three_legs import three_legs
from handey_studio.task.bench.motion.space_scenes import SpaceScene, space_scene
from handey_studio.world import Robot, World

STEPS_DEG = (5.0, 2.5)
ASKED = 10  # paths a scene, in the space that is there
Times = dict[str, list[float]]


def measure_spaces(robot: Robot, seeds: range, tell: Callable[[str], None], progress: Progress) -> dict[str, Any]:
    """Seconds of each kind over the scenes of some seeds, all in this process, compiled code warm."""
    warm_up(robot)
    times: Times = {}
    for number, seed in enumerate(seeds):
        if progress.cancelled:
            break
        progress.report(number / len(seeds), f"scene {seed}")
        for what, seconds in _scene_times(space_scene(robot, seed), seed):
            times.setdefault(what, []).append(seconds)
    summary = {what: _spread(values) for what, values in times.items()}
    for what, numbers in summary.items():
        tell(f"{what:44}{1e3 * numbers['median']:9.1f}{1e3 * numbers['p95']:9.1f} ms  ({numbers['count']})")
    return {"robot": robot.name, "seconds": summary}


def _scene_times(scene: SpaceScene, seed: int) -> Iterator[tuple[str, float]]:
    for step in STEPS_DEG:
        fresh = rescanned(scene, seed + int(10 * step))
        seconds, _ = _taken(lambda fresh=fresh, step=step: _built(fresh.world, fresh, step).regions)
        yield f"from a new depth map to the space, {step:g}°", seconds
        seconds, _ = _taken(lambda fresh=fresh, step=step: _built(fresh.moved, fresh, step).regions)
        yield f"one part moved, {step:g}°", seconds
    yield from _query_times(scene, seed)
    again = rescanned(scene, seed + 1)
    yield "the whole answer", _taken(lambda: _answered(again.world, again.start, again.goal, again.opening))[0]


def _query_times(scene: SpaceScene, seed: int) -> Iterator[tuple[str, float]]:
    """Paths between other places of the arm, the wrist's way being the same, in a space that is there."""
    layers, rng = _built(scene.world, scene, STEPS_DEG[0]), np.random.default_rng(seed)
    for _ in range(ASKED):
        start, goal = (_elsewhere(layers, asked, rng) for asked in (scene.start, scene.goal))
        seconds, found = _taken(lambda start=start, goal=goal: _searched(scene, start, goal))
        if found:
            yield "a query in a space that is there", seconds
            seconds, _ = _taken(lambda s=start, g=goal: _answered(scene.world, s, g, scene.opening, PathOptions(straight=False)))
            yield "the same, shortened, certified and timed", seconds


def rescanned(scene: SpaceScene, seed: int) -> SpaceScene:
    """The scene after another look: each reading a little different, and each part's pose."""
    rng, old = np.random.default_rng(seed), scene.world.terrain
    if old is None:
        return scene
    terrain = HeightField(old.top + rng.normal(0.0, 1e-5, old.top.shape), old.cell, old.T_world_range)
    parts = tuple(replace(part, T_world_part=transform(None, rng.normal(0.0, 1e-5, 3)) @ part.T_world_part) for part in scene.world.parts)
    world = replace(scene.world, terrain=terrain, parts=parts)
    return replace(scene, world=world, moved=world.with_part(scene.moved.parts[-1]))


def _asked(world: World, start: NDArray, goal: NDArray, opening: float) -> Query:
    return query(world, start, goal, opening, None, (), (), PathOptions())[0]


def _built(world: World, scene: SpaceScene, step_deg: float) -> Layers:
    """The space of one wrist box, its free regions found: collision bodies, distance field, slices, regions."""
    wrists = np.array([scene.start, scene.goal])[:, world.robot.other_index]
    return layers_of(_asked(world, scene.start, scene.goal, scene.opening), [wrists], float(np.deg2rad(step_deg)))


def _searched(scene: SpaceScene, start: NDArray, goal: NDArray) -> bool:
    asked = _asked(scene.world, start, goal, scene.opening)
    wrists = np.array([start, goal])[:, scene.world.robot.other_index]
    return len(three_legs(asked, layers_of(asked, [wrists], float(np.deg2rad(STEPS_DEG[0])))).points) > 0


def _answered(world: World, start: NDArray, goal: NDArray, opening: float, options: PathOptions | None = None) -> None:
    result = plan_path(world, start, goal, opening, options=options)
    if result.found:
        time_path(world.robot, result, opening)


def _elsewhere(layers: Layers, q: NDArray, rng: np.random.Generator) -> NDArray:
    """A configuration with the arm joints in a free cell of the space, near one anyway; q itself when there is none."""
    space = layers.spaces[0]
    free = np.argwhere(~space.blocked)
    return space.at(free[rng.integers(len(free))], q) if len(free) else q


def _taken(work: Callable[[], Any]) -> tuple[float, Any]:
    begun = time.perf_counter()
    done = work()
    return time.perf_counter() - begun, done


def _spread(values: Sequence[float]) -> dict[str, float]:
    return {"median": float(np.median(values)), "p95": float(np.percentile(values, 95)), "count": len(values)}


COLD = """
import numpy as np
from handey_studio.motion import PathOptions, plan_path
from handey_studio.world import Library, World
robot = Library.choose({library!r}).robot({robot!r})
step = np.where(robot.upper - robot.home > 0.6, 0.5, -0.5)
found = plan_path(World(robot), robot.home, robot.home + step, robot.hand.opening_max, options=PathOptions(straight=False))
raise SystemExit(0 if found.q_rad is not None else 1)
"""


def cold_start(robot: str, library: str | None, times: int = 3) -> float:
    """Seconds, the least of some, that a fresh process takes to its first path, compiled code being on the disk."""
    program = [sys.executable, "-c", COLD.format(robot=robot, library=library)]
    return min(_taken(lambda: subprocess.run(program, check=True))[0] for _ in range(times))
