"""One attempt at a planned MOVE: look again, perform, look at what came of it, and after an incident bring things back."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Progress, Share, Value
from handey_studio.cell.protocol import CannotAct, Cell
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.task.acting.looking import changed, check_place, wrong_place
from handey_studio.task.acting.perform import Performer, Task
from handey_studio.task.acting.performance import Incident, Performance
from handey_studio.task.acting.recover import RecoveryOptions, felt_block
from handey_studio.task.acting.stopping import stopping
from handey_studio.task.acting.way_back import CameBack, come_back
from handey_studio.task.plan import MovePlan
from handey_studio.task.planning import Station, sense
from handey_studio.task.remembering import known_after, remembered
from handey_studio.task.sense import Scene, believed_world
from handey_studio.world import Block, PlacedPart, World

ACTED = 0.9  # how much of an attempt's progress is behind when the arm is done


@dataclass(frozen=True, eq=False)
class Tried(Value):
    """How an attempt went: `incident` is what ended it, None if it ended well; `back` what was done then, at `q` (joints,) [rad] and with
    what was felt there. `seen` is the last scan, `after` the scene that the check saw."""

    performance: Performance = field(default_factory=Performance)
    incident: Incident | None = None
    back: CameBack = field(default_factory=CameBack)
    q: NDArray = field(default_factory=lambda: np.empty(0))
    felt: Block | None = None
    seen: DepthMap | None = None
    after: Scene | None = None


def attempt(
    station: Station, scene: Scene, plan: MovePlan, cell: Cell, options: RecoveryOptions, felt: tuple[Block, ...], seed: int,
    progress: Progress,
) -> Tried:  # fmt: skip
    """Carry out a plan that was made in a scene; `felt` are blocks that nobody saw."""
    seen = cell.scan() if options.look_again else None
    moved = changed(scene.depth_map, seen) if seen is not None else None
    if moved is not None:
        return Tried(Performance(incidents=(moved,)), moved, q=cell.joints(), seen=seen)
    world = _with_felt(believed_world(station.workcell, station.robot, scene), felt)
    performer = Performer(Task(plan, station.models[plan.part.split("#")[0]], world.without(plan.part)), cell)
    with stopping(cell, progress):
        incident = performer.perform(Share(progress, 0.0, ACTED))
        if incident is not None:
            return _brought_back(performer, incident, progress)
    return _looked_at(station, scene, plan, performer.told(), cell, options, seed, Share(progress, ACTED, 1.0))


def _looked_at(
    station: Station, scene: Scene, plan: MovePlan, done: Performance, cell: Cell, options: RecoveryOptions, seed: int, progress: Progress
) -> Tried:
    """The check: where the part stands now, by a new scan. What comes of it is known in the scenes to come."""
    try:
        seen = sense(station, cell, seed, progress)
    except CannotAct as error:
        refused = Incident("refused", len(plan.steps), str(error))
        return Tried(replace(done, incidents=(*done.incidents, refused)), refused, q=cell.joints())
    part, released = station.models[plan.part.split("#")[0]], done.T_world_part_released
    check = check_place(seen, part, plan.T_world_part_goal, plan.T_world_part_goal if released is None else released)
    incident = wrong_place(check, options.place, len(plan.steps))
    incidents = done.incidents if incident is None else (*done.incidents, incident)
    reached = check.T_world_part if check.T_world_part is not None else released if incident is None else None
    after = remembered(seen, known_after(scene, plan.part, reached))
    return Tried(replace(done, check=check, incidents=incidents), incident, q=cell.joints(), seen=after.depth_map, after=after)


def _brought_back(performer: Performer, incident: Incident, progress: Progress) -> Tried:
    """What the hand felt there, then the way back."""
    q, cell, task = performer.cell.joints(), performer.cell, performer.task
    felt, back = None, CameBack()
    if incident.kind not in ("stopped", "refused"):
        held = task.held(task.plan.carry_at(incident.step)) if performer.holding else None
        if incident.kind == "blocked":
            felt = felt_block(cell.wrench(), performer.acting.hand_now(), task.carried.robot, cell.opening(), held)
        back = come_back(performer, incident.step, _without_hand(performer, felt), progress)
    performer.incidents += [back.stopped] if back.stopped is not None else []
    return Tried(performer.told(), incident, back, q, felt)


def _without_hand(performer: Performer, felt: Block | None) -> World:
    """The world in which a new way home is looked for: with the part where it was let go, and what was felt."""
    task, told = performer.task, performer.told()
    world = _with_felt(task.carried, (felt,) if felt is not None else ())
    if told.T_world_part_released is None or performer.holding:
        return world
    return world.with_part(PlacedPart(task.plan.part, task.part, told.T_world_part_released))


def _with_felt(world: World, felt: tuple[Block, ...]) -> World:
    return replace(world, blocks=(*world.blocks, *felt))
