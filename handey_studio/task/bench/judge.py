"""Whether a MOVE that was spoilt could still be done: judged by the truth, for the benchmark alone.

It can be when the part still lies where the range finder looks, shows enough of itself, and there is a plan for one who knows exactly
where it lies. A part that was flung out of sight, or fell so that no hand can take it, is past recovery: its loss must be noticed and told.
"""

from dataclasses import replace

import numpy as np

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.physics.physical import PhysicalCell
from handey_studio.cell.scenes.alike import seen_alike
from handey_studio.cell.scenes.fitness import visible_share
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.grasping import stable_placements
from handey_studio.task.move import MoveOptions
from handey_studio.task.plan import MoveCommand
from handey_studio.task.planning import Station, plan_in, sense
from handey_studio.world import Part, PlacedPart

SHOWS = 0.5  # the share of a part from which it must be recognised
UP = np.cos(np.deg2rad(5.0))  # a part stands in a placement when its up is so near to it


def past_recovery(station: Station, cell: PhysicalCell, command: MoveCommand, seed: int) -> str:
    """Why the MOVE can be done no more, as things stand in the cell now; empty when it can."""
    if cell.held_truly() is not None:
        return "the hand holds the part and does not let go"
    bodies, part, finder = cell.true_scene(), station.models[command.part], station.workcell.finder
    body = next(body for body in bodies if body.name == command.part)
    corners = apply(inverse(finder.T_world_range), body.corners_world)[:, :2]
    if ((corners < 0) | (corners > finder.area)).any():
        return "the part lies beyond the range finder's view"
    shows = visible_share(finder, bodies, body)
    if shows < SHOWS:
        return f"{100 * shows:.0f} % of the part show"
    if _alike(part, body):
        return "the part stands so that no view from above can tell how"
    scene = sense(station, cell, seed)
    known = replace(scene, instances=(PlacedPart(f"{part.name}#1", part, body.T_world_body),), known=(f"{part.name}#1",))
    planned = plan_in(station, known, command, cell.joints(), cell.opening(), MoveOptions(seed=seed))
    return "" if planned.plan is not None else f"there is no plan even for one who knows where it lies: {planned.reason}"


def _alike(part: Part, body: SolidBody) -> bool:
    """Whether it stands as one of the placements that look like another from straight above."""
    placements, _ = stable_placements(part)
    stands = (float(placed.T_plane_part[2, :3] @ body.T_world_body[2, :3]) > UP for placed in placements)
    return any(here and alike for here, alike in zip(stands, seen_alike(part), strict=True))
