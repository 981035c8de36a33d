"""Handey Studio: locate parts in a pile, choose grasps, plan and place, and understand every decision.

    import handey_studio as hs

    library = hs.Library.choose()
    session = hs.read_session(hs.find_session(library, "figure1"))
    station, cell = hs.station_of(session, library), hs.cell_of(session, library)
    scene, result = hs.run_move(station, cell, session.commands[0])
    print(result.status, result.plan.certificate.least_clearance)
"""

from handey_studio.base import BadInput, Entry, Progress, rejected_counts
from handey_studio.localization import LocateOptions, localize
from handey_studio.sensing.files import read_depth
from handey_studio.sensing.support import support_plane
from handey_studio.session import Session, find_session, new_session, read_session, write_session
from handey_studio.session.run import cell_of, station_of
from handey_studio.task import MoveCommand, MoveOptions, MoveResult, Station, execute_in, plan_in, run_move, sense
from handey_studio.world import Library, Part, PlacedPart, Robot, World, load_robot, read_part

__all__ = [
    "BadInput",
    "Entry",
    "Library",
    "LocateOptions",
    "MoveCommand",
    "MoveOptions",
    "MoveResult",
    "Part",
    "PlacedPart",
    "Progress",
    "Robot",
    "Session",
    "Station",
    "World",
    "cell_of",
    "execute_in",
    "find_session",
    "load_robot",
    "localize",
    "new_session",
    "plan_in",
    "read_depth",
    "read_part",
    "read_session",
    "rejected_counts",
    "run_move",
    "sense",
    "station_of",
    "support_plane",
    "write_session",
]
