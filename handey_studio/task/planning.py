"""Sensing and planning at a station: what comes before anything moves."""

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Progress, Share, Silent, Value
from handey_studio.cell.protocol import Cell
from handey_studio.cell.workcell import Workcell
from handey_studio.localization import LocateOptions
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.task.carrying import Start
from handey_studio.task.move import MoveOptions, check_command, plan_move
from handey_studio.task.plan import MoveCommand, MoveResult
from handey_studio.task.remembering import remembered
from handey_studio.task.sense import Scene, believed_world, understand
from handey_studio.world import Block, Part, PlacedPart, Robot


@dataclass(frozen=True, eq=False)
class Station(Value):
    """What stays the same from MOVE to MOVE: the workcell, its robot, and the models of the parts."""

    workcell: Workcell
    robot: Robot
    parts: tuple[Part, ...]

    @property
    def models(self) -> dict[str, Part]:
        return {part.name: part for part in self.parts}


def sense(
    station: Station, cell: Cell, seed: int = 0, progress: Progress = Silent(), known: tuple[PlacedPart, ...] = ()
) -> Scene:  # fmt: skip
    """Scan the cell and find the station's parts; what was `known` of them before helps where the scan alone cannot tell."""
    _check_parts(station)
    progress.report(0.0, "scanning")
    begun = time.perf_counter()
    depth_map = cell.scan()
    scanned = time.perf_counter() - begun
    scene = understood(station, depth_map, seed, Share(progress, 0.3, 1.0), known)
    return replace(scene, timing_s={"scan": scanned} | scene.timing_s)


def understood(
    station: Station, depth_map: DepthMap, seed: int = 0, progress: Progress = Silent(), known: tuple[PlacedPart, ...] = ()
) -> Scene:
    """Find the station's parts in a scan that was taken, with what was `known` before it."""
    _check_parts(station)
    options = LocateOptions(table_z_m=station.workcell.table_z)
    return remembered(understand(depth_map, station.parts, np.random.default_rng(seed), options, progress), known)


def plan_in(
    station: Station,
    scene: Scene,
    command: MoveCommand,
    q: NDArray,
    opening: float,
    options: MoveOptions = MoveOptions(),
    progress: Progress = Silent(),
    felt: tuple[Block, ...] = (),
) -> MoveResult:
    """Plan a MOVE in a sensed scene, from where the arm stands; `felt` are blocks that were touched and never seen."""
    check_command(command, station.models)
    begun = time.perf_counter()
    world = believed_world(station.workcell, station.robot, scene)
    world = replace(world, blocks=(*world.blocks, *felt)) if felt else world
    built = time.perf_counter() - begun
    result = plan_move(world, command, station.models, Start(q, opening, station.robot.home), options, progress, scene.doubts)
    return replace(result, timing_s=scene.timing_s | {"world": built} | result.timing_s)


def _check_parts(station: Station) -> None:
    if not station.parts:
        raise BadInput("the session knows no parts; add at least one before a MOVE.")
