"""What a plan found: the path of the hand, and how near it comes to anything."""

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.scene.units import scaled
from handey_studio.app.state import State
from handey_studio.session import Replay
from handey_studio.task.carrying import TOLD_M

PATH, BEADS = "/plan/hand_path", "/plan/clearance"
SAMPLES = 240


class PlanScene:
    """The path, coloured by step, and beads along it, coloured by clearance."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._root: viser.FrameHandle | None = None
        self._path: viser.SceneNodeHandle | None = None
        self._beads: viser.SceneNodeHandle | None = None

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        if old is None or old.replay is not new.replay:
            self._build(new)
        self._show(new)

    def _build(self, state: State) -> None:
        scene = self._server.scene
        scene.remove_by_name("/plan")
        self._path = self._beads = None
        replay = state.replay
        if replay is None:
            return
        scene.add_frame("/plan", show_axes=False)
        hand = replay.hand_path(SAMPLES)
        points, colours = coloured_path(replay, hand)
        self._path = scene.add_line_segments(PATH, scaled(points), colors=colours, thickness=3.0, thickness_units="screen")
        beads = clearance_beads(replay, hand)
        if beads is not None:
            self._beads = scene.add_point_cloud(
                BEADS, scaled(beads[0]), beads[1], point_size=0.03, point_shape="circle", precision="float32"
            )

    def _show(self, state: State) -> None:
        hidden = state.session.view.hidden_layers
        for handle, layer in ((self._path, "hand path"), (self._beads, "clearance")):
            if handle is not None and handle.visible != (layer not in hidden):
                handle.visible = layer not in hidden


def coloured_path(replay: Replay, points: NDArray) -> tuple[NDArray, NDArray]:
    """Segments (n - 1, 2, 3) [m] of the fingertips' path through points (n, 3), evenly in time, and their colours (n - 1, 2, 3)."""
    times = np.linspace(0.0, replay.duration, len(points))
    kinds = [replay.plan.steps[replay.step_at(t)].kind for t in times[:-1]]
    colours = np.array([palette.STEP_COLOURS[kind] for kind in kinds], dtype=np.uint8)
    return np.stack([points[:-1], points[1:]], axis=1), np.repeat(colours[:, None], 2, axis=1)


def clearance_beads(replay: Replay, points: NDArray) -> tuple[NDArray, NDArray] | None:
    """Points (n, 3) [m] of the fingertips' path, evenly in time, with their colours (n, 3) by how near anything then comes to the arm."""
    times = np.linspace(0.0, replay.duration, len(points))
    told = [replay.clearance(t) for t in times]
    if None in told:
        return None
    return points, palette.clearance_colours(np.array(told, dtype=float) / TOLD_M)


def _looks(state: State) -> tuple:
    return id(state.replay), state.session.view.hidden_layers
