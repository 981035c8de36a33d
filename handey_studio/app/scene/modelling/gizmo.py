"""An arrow, or three, on what is selected: dragging it moves the face, edge or corner, one step a drag."""

from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app.modelling import derived
from handey_studio.app.modelling.look import SELECT
from handey_studio.app.modelling.steps import MovePickedBy, PreviewMove
from handey_studio.app.scene.units import metres, place
from handey_studio.app.state import State
from handey_studio.app.wire import Send
from handey_studio.geometry.transforms import transform
from handey_studio.modeling.picking.snap import Snap
from handey_studio.modeling.references import FaceAt
from handey_studio.modeling.sketch_plane import sketch_plane
from handey_studio.session.strokes import on_model

NAME = "/model/gizmo"


class GizmoScene:
    """Along a face's normal; along all three axes at an edge or a corner. While it is dragged the model is shown as it would be."""

    def __init__(self, server: viser.ViserServer, send: Send) -> None:
        self._scene, self._send = server.scene, send
        self._gizmo: viser.TransformControlsHandle | None = None
        self._start = np.zeros(3)

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        if self._gizmo is not None:
            self._gizmo.remove()
            self._gizmo = None
        snap = _movable(new)
        if snap is not None:
            self._build(snap)

    def _build(self, snap: Snap) -> None:
        face = isinstance(on_model(snap), FaceAt)
        T = sketch_plane(snap.point, snap.normal) if face else transform(None, snap.point)
        self._start = T[:3, 3]
        self._gizmo = self._scene.add_transform_controls(
            NAME,
            scale=0.45,
            line_width=4.0,
            active_axes=(not face, not face, True),
            disable_sliders=True,
            disable_rotations=True,
            depth_test=False,
        )
        place(self._gizmo, T)

        @self._gizmo.on_update
        def _(event: viser.TransformControlsEvent) -> None:
            if event.client is not None and event.phase in ("update", "end"):
                way = self._way(event.target)
                self._send(MovePickedBy(way) if event.phase == "end" else PreviewMove(way))

    def _way(self, gizmo: Any) -> NDArray:
        return metres(gizmo.position) - self._start


def _movable(state: State) -> Snap | None:
    """What is selected, if it is one thing of the model that can be moved."""
    picked = state.model.picked
    if derived.draft_of(state) is None or state.model.tool != SELECT or len(picked) != 1 or on_model(picked[0]) is None:
        return None
    return picked[0]


def _looks(state: State) -> tuple:
    shown = derived.built(state)
    return state.loads, id(_movable(state)), id(shown.solid) if shown is not None else 0, state.model.drags
