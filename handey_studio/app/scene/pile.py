"""What stands in the simulated cell before anything is scanned: what a person sees who walks up to it.

It is the cell's own state, for the eye alone. Once there is a scan the screen shows what was sensed instead.
"""

import viser

from handey_studio.app import palette
from handey_studio.app.scene.parts import add_solid
from handey_studio.app.state import State
from handey_studio.cell import TrueBody
from handey_studio.geometry import box
from handey_studio.session import Session
from handey_studio.world import Library, Part

ROOT = "/pile"


class PileScene:
    """One grey solid a body, until the first scan."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._frames: list[viser.FrameHandle] = []

    def render(self, old: State | None, new: State) -> None:
        if old is None or _setup(old.session) is not _setup(new.session):
            self._build(new)
            old = None
        shown = _shown(new)
        if old is None or shown != _shown(old):
            for frame in self._frames:
                frame.visible = shown

    def _build(self, state: State) -> None:
        for frame in self._frames:
            frame.remove()
        setup = _setup(state.session)
        bodies = () if setup.drop else setup.bodies  # what is still to fall stands nowhere yet
        solids = [(body, solid_of(state.session, state.library, body)) for body in bodies]
        self._frames = [
            add_solid(self._server.scene, f"{ROOT}/{number}", part, palette.UNSCANNED, body.T_world_body)[0]
            for number, (body, part) in enumerate(solids)
            if part is not None
        ]


def _shown(state: State) -> bool:
    return state.session.scan is None and not state.modelling


def solid_of(session: Session, library: Library, body: TrueBody) -> Part | None:
    """The shape of a body: a part of the session or else of the library, or a cuboid; None when nobody knows that part."""
    if body.size is not None:
        return Part(body.name, box(body.size))
    known = session.part(body.part) if body.part else None
    return library.part(body.part) if known is None and body.part in library.part_files() else known


def _setup(session: Session):
    return session.cell_now or session.workcell.setup
