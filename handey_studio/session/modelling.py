"""Modelling in a session's cell: scan an object, turn it over, and find the part that was modelled in the cell's pile."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, Progress
from handey_studio.cell.protocol import CannotAct
from handey_studio.cell.turning import turned_over
from handey_studio.geometry import Polyhedron
from handey_studio.geometry.transforms import apply, inverse, rotation_about
from handey_studio.modeling.draft import Draft
from handey_studio.modeling.operations import TakeSuggestion
from handey_studio.modeling.patches.finding import patches_of
from handey_studio.modeling.replay import Built, replay
from handey_studio.modeling.scans import CELL_SCAN, scan_of_map
from handey_studio.modeling.truth_values import Truth
from handey_studio.session.model_look import assumed_faces
from handey_studio.session.run import cell_of, station_of
from handey_studio.session.session import Session
from handey_studio.task import sense
from handey_studio.world import Library, Part
from handey_studio.world.part import Provenance
from handey_studio.world.part_writing import check_part_name

LEVEL_M = 1e-4  # an edge that rises by less lies level
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

    It is the one that is being modelled, where a scan of the cell shows it, else the one nearest to the scan's middle. Only the cell's
    hidden truth changes. Raises BadInput when there is nothing to turn.
    """
    progress.report(0.1, "The object is turned over by hand.")
    workcell = session.workcell if session.cell_now is None else replace(session.workcell, setup=session.cell_now)
    return replace(session.without_findings(), cell_now=turned_over(workcell, library, _modelled_at(session.draft)))


def _modelled_at(draft: Draft | None) -> NDArray | None:
    """Where in the cell (3,) [m] the object that is modelled lay in the last scan of the cell whose place is known: its solid's middle, or
    while there is none, that of the largest object; None without such a scan."""
    built = None if draft is None else replay(draft)
    if draft is None or built is None:
        return None
    poses = dict(built.poses)
    scan = next((scan for scan in reversed(draft.scans) if scan.source == CELL_SCAN and scan.name in poses), None)
    if scan is None:
        return None
    if built.solid is not None:
        return apply(inverse(poses[scan.name]), built.solid.vertices.min(axis=0) / 2.0 + built.solid.vertices.max(axis=0) / 2.0)
    patches = patches_of(scan)
    corners = [patches.patches[number].rings[0] for group in patches.objects[:1] for number in group]
    return np.concatenate(corners).mean(axis=0) if corners else None


def find_parts(session: Session, library: Library, execute: bool, progress: Progress) -> Session:
    """The session with its cell scanned and its parts located in the scan; nothing is planned."""
    try:
        scene = sense(station_of(session, library), cell_of(session, library), session.seed, progress)
    except CannotAct as error:
        raise BadInput(str(error)) from None
    return replace(session, scene=scene, results=())


def part_of(solid: Polyhedron, name: str, density: float, friction: float, provenance: Provenance) -> Part:
    """A modelled solid as a part: its frame has the model's z, the origin below its middle on the plane that it stands on, and x along
    its longest level edge. Raises BadInput when the name cannot be used."""
    ways = np.array([solid.vertices[edge.end] - solid.vertices[edge.start] for edge in solid.edges])
    level = np.where(np.abs(ways[:, 2]) < LEVEL_M, np.linalg.norm(ways, axis=1), 0.0)
    x, y, _ = ways[int(np.argmax(level))] if level.max() > 0.0 else (1.0, 0.0, 0.0)
    turn = rotation_about((0.0, 0.0, 1.0), -float(np.arctan2(y, x) % np.pi))
    turned = solid.vertices @ turn.T
    middle = (turned.min(axis=0) + turned.max(axis=0)) / 2.0
    moved = np.round(turned - (middle[0], middle[1], turned[:, 2].min()), 9) + 0.0
    return Part(check_part_name(name), Polyhedron(moved, solid.faces), density, friction, provenance=provenance)


def provenance_of(draft: Draft, built: Built, judged: Truth | None) -> Provenance:
    """Where a model came from, as its part remembers it."""
    scans = tuple(scan.name for scan in draft.scans)
    source = f"modelled from {len(scans)} scan{'s' if len(scans) != 1 else ''}" if scans else _made_from(draft)
    assumed = assumed_faces(built.sources)
    if judged is None or not scans:
        return Provenance(source, scans, assumed_faces=assumed)
    return Provenance(source, scans, judged.rms, judged.explained, judged.seen, assumed)


def _made_from(draft: Draft) -> str:
    """Where a model without scans began: in a file that was imported, else nowhere."""
    taken = [step.sources[0] for step in draft.operations if isinstance(step, TakeSuggestion)]
    return next((source for source in taken if source.startswith("imported")), "modelled by hand")


def with_part(session: Session, part: Part) -> Session:
    """The session whose workcell knows one more part, or this model of it in place of an older one."""
    if session.part(part.name) == part:
        return session
    others = tuple(known for known in session.parts if known.name != part.name)
    names = tuple(name for name in session.workcell.parts if name != part.name)
    workcell = replace(session.workcell, parts=(*names, part.name))
    return replace(session, parts=(*others, part), workcell=workcell, scene=None, results=())
