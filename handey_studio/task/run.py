"""A whole MOVE in a cell: sense, plan, execute."""

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Ledger, Progress, Share, Silent, Value
from handey_studio.cell.protocol import CannotAct, Cell
from handey_studio.cell.workcell import Workcell
from handey_studio.localization import LocateOptions
from handey_studio.task.carrying import Start
from handey_studio.task.execute import execute
from handey_studio.task.move import MoveOptions, check_command, plan_move
from handey_studio.task.plan import MoveCommand, MoveResult
from handey_studio.task.sense import Scene, believed_world, understand
from handey_studio.world import Part, Robot


@dataclass(frozen=True, eq=False)
class Station(Value):
    """What stays the same from MOVE to MOVE: the workcell, its robot, and the models of the parts."""

    workcell: Workcell
    robot: Robot
    parts: tuple[Part, ...]

    @property
    def models(self) -> dict[str, Part]:
        return {part.name: part for part in self.parts}


def sense(station: Station, cell: Cell, seed: int = 0, progress: Progress = Silent()) -> Scene:
    """Scan the cell and find the station's parts."""
    if not station.parts:
        raise BadInput("the session knows no parts; add at least one before a MOVE.")
    progress.report(0.0, "scanning")
    begun = time.perf_counter()
    depth_map = cell.scan()
    scanned = time.perf_counter() - begun
    options = LocateOptions(table_z_m=station.workcell.table_z)
    scene = understand(depth_map, station.parts, np.random.default_rng(seed), options, Share(progress, 0.3, 1.0))
    return replace(scene, timing_s={"scan": scanned} | scene.timing_s)


def plan_in(
    station: Station,
    scene: Scene,
    command: MoveCommand,
    q: NDArray,
    opening: float,
    options: MoveOptions = MoveOptions(),
    progress: Progress = Silent(),
) -> MoveResult:
    """Plan a MOVE in a sensed scene, from where the arm stands."""
    check_command(command, station.models)
    begun = time.perf_counter()
    world = believed_world(station.workcell, station.robot, scene)
    built = time.perf_counter() - begun
    result = plan_move(world, command, station.models, Start(q, opening, station.robot.home), options, progress, scene.doubts)
    return replace(result, timing_s=scene.timing_s | {"world": built} | result.timing_s)


def execute_in(station: Station, scene: Scene, result: MoveResult, cell: Cell, progress: Progress = Silent()) -> MoveResult:
    """Carry out a planned MOVE; the result with what came of it."""
    plan = result.plan
    if plan is None:
        return result
    ledger = Ledger()
    ledger.adopt(result.ledger)
    part = station.models[plan.part.split("#")[0]]
    carried = believed_world(station.workcell, station.robot, scene).without(plan.part)
    begun = time.perf_counter()
    ended = execute(plan, carried, part, cell, ledger, progress)
    return replace(
        result,
        status="done" if ended.done else "failed",
        reason=ended.reason,
        T_world_part_reached=ended.T_world_part_reached,
        ledger=ledger.entries,
        physics=cell.physics,
        timing_s=result.timing_s | {"execute": time.perf_counter() - begun},
    )


def run_move(
    station: Station,
    cell: Cell,
    command: MoveCommand,
    options: MoveOptions = MoveOptions(),
    execute_too: bool = True,
    progress: Progress = Silent(),
) -> tuple[Scene | None, MoveResult]:
    """Sense, plan and, if wanted, execute one MOVE. Bad input raises; everything else is a result."""
    check_command(command, station.models)
    try:
        scene = sense(station, cell, options.seed, Share(progress, 0.0, 0.2))
    except CannotAct as error:
        return None, MoveResult(command, "failed", str(error))
    result = plan_in(station, scene, command, cell.joints(), cell.opening(), options, Share(progress, 0.2, 0.9))
    if execute_too and result.plan is not None and not progress.cancelled:
        result = execute_in(station, scene, result, cell, Share(progress, 0.9, 1.0))
    return scene, result
