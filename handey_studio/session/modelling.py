"""Modelling in a session's cell: scan an object, turn it over, and find the part that was modelled in the cell's pile."""

from dataclasses import replace

from handey_studio.base import BadInput, Progress
from handey_studio.cell.protocol import CannotAct
from handey_studio.cell.turning import turned_over
from handey_studio.modeling.draft import Draft
from handey_studio.modeling.scans import scan_of_map
from handey_studio.session.run import cell_of, station_of
from handey_studio.session.session import Session
from handey_studio.task import sense
from handey_studio.world import Library, Part

SCANNED = "scan"  # what the scan is called until it joins a draft


def scan_cell(session: Session, library: Library, execute: bool, progress: Progress) -> Session:
    """The session with a draft that holds one new scan of its cell and nothing else. Raises BadInput when the cell cannot scan."""
    progress.report(0.1, "The range finder scans the cell.")
    try:
        depth_map = cell_of(session, library).scan()
    except CannotAct as error:
        raise BadInput(str(error)) from None
    return replace(session, draft=Draft(SCANNED, (scan_of_map(SCANNED, depth_map),)))


def turn_over(session: Session, library: Library, execute: bool, progress: Progress) -> Session:
    """The session after a person turned the object in its simulated cell over; what was sensed and planned before is stale and goes.

    Only the cell's hidden truth changes. Raises BadInput when there is nothing to turn.
    """
    progress.report(0.1, "The object is turned over by hand.")
    workcell = session.workcell if session.cell_now is None else replace(session.workcell, setup=session.cell_now)
    return replace(session.without_findings(), cell_now=turned_over(workcell, library))


def find_parts(session: Session, library: Library, execute: bool, progress: Progress) -> Session:
    """The session with its cell scanned and its parts located in the scan; nothing is planned."""
    try:
        scene = sense(station_of(session, library), cell_of(session, library), session.seed, progress)
    except CannotAct as error:
        raise BadInput(str(error)) from None
    return replace(session, scene=scene, results=())


def with_part(session: Session, part: Part) -> Session:
    """The session whose workcell knows one more part, or this model of it in place of an older one."""
    if session.part(part.name) == part:
        return session
    others = tuple(known for known in session.parts if known.name != part.name)
    names = tuple(name for name in session.workcell.parts if name != part.name)
    workcell = replace(session.workcell, parts=(*names, part.name))
    return replace(session, parts=(*others, part), workcell=workcell, scene=None, results=())
