"""Handey Studio: locate parts in a pile, choose grasps, plan and place, and understand every decision.

import handey_studio as hs

library = hs.Library.choose()
session = hs.read_session(hs.find_session(library, "figure1"))
station, cell = hs.station_of(session, library), hs.cell_of(session, library)
result = hs.run_move(station, cell, session.commands[0]).result
print(result.status, result.plan.certificate.least_clearance, result.check.sentence)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from handey_studio.base import BadInput, Entry, Progress, rejected_counts
    from handey_studio.localization import LocateOptions, localize
    from handey_studio.sensing.reading.files import read_depth
    from handey_studio.sensing.support import support_plane
    from handey_studio.session import Session, find_session, new_session, read_session, write_session
    from handey_studio.session.run import cell_of, station_of
    from handey_studio.task import MoveCommand, MoveOptions, MoveResult, RecoveryOptions, Station, execute_in, plan_in, run_move, sense
    from handey_studio.world import Library, Part, PlacedPart, Robot, World, load_robot, read_part

_HOMES = {
    "base": ("BadInput", "Entry", "Progress", "rejected_counts"),
    "localization": ("LocateOptions", "localize"),
    "sensing.files": ("read_depth",),
    "sensing.support": ("support_plane",),
    "session": ("Session", "find_session", "new_session", "read_session", "write_session"),
    "session.run": ("cell_of", "station_of"),
    "task": ("MoveCommand", "MoveOptions", "MoveResult", "RecoveryOptions", "Station", "execute_in", "plan_in", "run_move", "sense"),
    "world": ("Library", "Part", "PlacedPart", "Robot", "World", "load_robot", "read_part"),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Each name is imported from its room when it is first asked for, so that a command loads only what it needs."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


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
    "RecoveryOptions",
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
