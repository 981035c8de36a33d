"""A whole MOVE in a cell: sense, plan, execute."""

from dataclasses import replace

from handey_studio.base import Progress, Share, Silent
from handey_studio.cell.protocol import CannotAct, Cell
from handey_studio.task.acting.execution import Order, Outcome, carry_out
from handey_studio.task.acting.recover import RecoveryOptions
from handey_studio.task.move import MoveOptions, check_command
from handey_studio.task.plan import MoveCommand, MoveResult
from handey_studio.task.planning import Station, plan_in, sense
from handey_studio.task.sense import Scene
from handey_studio.world import PlacedPart

SENSED, PLANNED = 0.1, 0.4  # how much of a whole MOVE's progress is behind when it is sensed, and when it is planned


def execute_in(
    station: Station,
    scene: Scene,
    result: MoveResult,
    cell: Cell,
    progress: Progress = Silent(),
    options: MoveOptions = MoveOptions(),
    recovery: RecoveryOptions = RecoveryOptions(),
) -> MoveResult:
    """Carry out a MOVE that was planned in a scene, within the budget of `recovery`; the result with what came of it."""
    return carry_out(Order(station, result.command, options, recovery), scene, result, cell, progress).result


def run_move(
    station: Station,
    cell: Cell,
    command: MoveCommand,
    options: MoveOptions = MoveOptions(),
    execute_too: bool = True,
    progress: Progress = Silent(),
    recovery: RecoveryOptions = RecoveryOptions(),
    scene: Scene | None = None,
    known: tuple[PlacedPart, ...] = (),
) -> Outcome:
    """Sense (unless a scene is given that was sensed before), plan and, if wanted, execute one MOVE. Bad input raises; everything else is a
    result. What is to be executed and cannot be planned is looked at once more, by another scan. `known` are parts that were seen or put
    down before, for where a scan alone cannot tell."""
    known = scene.instances if scene is not None else known
    check_command(command, station.models)
    result = MoveResult(command, "failed", "")
    for look in range(recovery.looks if execute_too else 1):
        try:
            if scene is None or look > 0:
                scene = sense(station, cell, options.seed + look, Share(progress, 0.0, SENSED), known)
        except CannotAct as error:
            return Outcome(replace(result, reason=str(error)), None)
        if progress.cancelled:
            return Outcome(replace(result, reason="cancelled"), None)
        result = plan_in(station, scene, command, cell.joints(), cell.opening(), options, Share(progress, SENSED, PLANNED))
        if result.plan is not None or progress.cancelled:
            break
    if scene is None or not execute_too or result.plan is None or progress.cancelled:
        return Outcome(result, scene)
    return carry_out(Order(station, command, options, recovery), scene, result, cell, Share(progress, PLANNED, 1.0))
