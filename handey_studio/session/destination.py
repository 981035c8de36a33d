"""The destination on the screen: where the ghost stands, what can be chosen, and how a ghost that was let go snaps."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import apply, from_xyz_rpy, to_xyz_rpy
from handey_studio.session.session import Session
from handey_studio.task.destination import base_name, goal_poses, parse_destination
from handey_studio.task.plan import MoveCommand
from handey_studio.world import Part, PlacedPart

SNAP_M, SNAP_RAD = 0.001, np.deg2rad(1.0)
UPRIGHT_RAD = np.deg2rad(4.5)  # turned by hand this close to a quarter turn means the quarter turn; between whole degrees
DROP_M = 0.012  # let go this close to the table, or below it, means standing on it


def check_command(session: Session, command: MoveCommand) -> None:
    """Raises BadInput with one sentence when a command cannot be meant in this session."""
    parts = {part.name: part for part in session.parts}
    if base_name(command.part) not in parts:
        raise BadInput(f'part "{command.part[:60]}" is not in this workcell; it has {", ".join(sorted(parts)) or "none"}.')
    parse_destination(command.to, command.part, parts)


def destination_pose(session: Session, command: MoveCommand) -> NDArray | None:
    """T_world_part that a valid command asks for, None while it hangs on a part that is not located yet."""
    parts = {part.name: part for part in session.parts}
    moved = moved_part(session, command)
    name = moved.name if moved else command.part
    goals = goal_poses(parse_destination(command.to, command.part, parts), name, parts, session.located)
    return goals[0][1] if goals else None


def moved_part(session: Session, command: MoveCommand) -> PlacedPart | None:
    """The located instance that a command means: the one it names, else the first of that part."""
    return next((placed for placed in session.located if command.part in (placed.name, placed.part.name)), None)


def destinations_on_parts(session: Session, part: Part) -> tuple[str, ...]:
    """The `on:PART:POSE` destinations that the mating poses in this workcell offer a part."""
    return tuple(f"on:{other.name}:{name}" for other in session.parts for name, mate in other.mates.items() if mate.part == part.name)


def anywhere(session: Session) -> str:
    """The destination `in:x0,y0,x1,y1` that is the whole scanned area, seen along the table's axes."""
    finder = session.workcell.finder
    corners = apply(finder.T_world_range, [(x, y, 0.0) for x in (0.0, finder.area[0]) for y in (0.0, finder.area[1])])
    (x0, y0), (x1, y1) = corners[:, :2].min(axis=0) + 0.0, corners[:, :2].max(axis=0) + 0.0
    return f"in:{x0:.3f},{y0:.3f},{x1:.3f},{y1:.3f}"


def snapped(part: Part, T_world_part: NDArray, table_z: float) -> NDArray:
    """A pose let go by hand: whole millimetres and degrees, upright when nearly so, and on the table when near it."""
    xyz, rpy = to_xyz_rpy(T_world_part)
    quarter = np.round(rpy / (np.pi / 2)) * (np.pi / 2)
    rpy = np.where(np.abs(rpy - quarter) < UPRIGHT_RAD, quarter, np.round(rpy / SNAP_RAD) * SNAP_RAD)
    T = from_xyz_rpy(np.round(xyz / SNAP_M) * SNAP_M, rpy)
    gap = part.lowest(T) - table_z
    if gap < DROP_M:
        T[2, 3] -= gap
    return T
