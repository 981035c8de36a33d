"""The ghost of the part at its destination, moved by a gizmo; it snaps when it is let go."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handey_studio.app import palette
from handey_studio.app.commands import Command
from handey_studio.app.scene.parts import add_solid
from handey_studio.app.scene.units import metres, place
from handey_studio.app.setting_up import DropGhost
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.geometry.transforms import transform
from handey_studio.session.destination import destination_pose

GIZMO = "/destination"


class DestinationScene:
    """The gizmo carries the ghost below it, so that it follows the pointer without a round trip."""

    def __init__(self, server: viser.ViserServer, send: Callable[[Command], None]) -> None:
        self._server, self._send = server, send
        self._gizmo: viser.TransformControlsHandle | None = None
        self._part = None

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        pose = ghost_pose(new)
        part = new.session.part(new.command.part) if new.command else None
        if part is None or pose is None:
            self._clear()
            return
        if part is not self._part or self._gizmo is None:
            self._clear()
            self._build(part, pose)
        self._update(new, pose)

    def _clear(self) -> None:
        if self._gizmo is not None:
            self._gizmo.remove()
        self._gizmo, self._part = None, None

    def _build(self, part, pose: NDArray) -> None:
        self._part = part
        self._gizmo = self._server.scene.add_transform_controls(GIZMO, scale=1.1, line_width=3.0, depth_test=False, opacity=0.85)
        place(self._gizmo, pose)
        add_solid(self._server.scene, f"{GIZMO}/ghost", part, palette.BLUE, transform(), opacity=0.38)

        @self._gizmo.on_update
        def _(event: viser.TransformControlsEvent) -> None:
            if event.client is not None and event.phase == "end":
                self._send(DropGhost(_pose_of(event.target)))

    def _update(self, state: State, pose: NDArray) -> None:
        """The gizmo shows where the ghost may be dragged: not on another part, and not while a plan is under way."""
        if self._gizmo is None:
            return
        place(self._gizmo, pose)
        fixed = (state.command is not None and state.command.to.startswith("on:")) or state.job is not None
        self._gizmo.disable_axes = self._gizmo.disable_sliders = self._gizmo.disable_rotations = fixed
        shown = "destination" not in state.session.view.hidden_layers and state.hypothesis is None
        self._gizmo.visible = shown and not _arrived(state)


def ghost_pose(state: State) -> NDArray | None:
    """T_world_part of the destination, None when it is not known yet or the command means nothing here."""
    result = state.session.result
    if state.command is None:
        return None
    if result is not None and result.command == state.command and result.T_world_part_goal is not None:
        return result.T_world_part_goal  # of several instances and places, the one that was planned for
    try:
        return destination_pose(state.session, state.command)
    except BadInput:
        return None


def _arrived(state: State) -> bool:
    """Whether the part stands at its destination at the time that is looked at, so that a ghost there would only blur it."""
    replay = state.replay
    if replay is None or not replay.let_go(state.session.view.time_s):
        return False
    pose = ghost_pose(state)
    return pose is not None and bool(np.allclose(replay.plan.T_world_part_goal, pose, atol=1e-6))


def _pose_of(gizmo: Any) -> NDArray:
    return transform(Rotation.from_quat(gizmo.wxyz, scalar_first=True).as_matrix(), metres(gizmo.position))


def _looks(state: State) -> tuple:
    session = state.session
    shown = session.view.hidden_layers, state.hypothesis is None, _arrived(state)
    return state.loads, session.commands, session.located, state.job is None, session.result, shown
