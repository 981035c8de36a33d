"""What a plan found: the path of the hand, the grasp with its faces and first edge."""

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.scene.units import place, scaled
from handey_studio.app.state import State
from handey_studio.session import Replay
from handey_studio.task.carrying import TOLD_M
from handey_studio.task.plan import Carry, GraspChoice

PATH, GRASP, BEADS = "/plan/hand_path", "/plan/grasp", "/plan/clearance"
SAMPLES = 240


class PlanScene:
    """The path, coloured by step, and the grasp in place on the part."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._root: viser.FrameHandle | None = None
        self._grasp: viser.FrameHandle | None = None
        self._path: viser.SceneNodeHandle | None = None
        self._beads: viser.SceneNodeHandle | None = None
        self._carry: Carry | None = None

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        if old is None or old.session.result is not new.session.result:
            self._build(new)
        elif new.replay is not None and self._carry is not new.carry:
            self._build_grasp(new)
        self._show(new)

    def _build(self, state: State) -> None:
        scene = self._server.scene
        scene.remove_by_name("/plan")
        self._path = self._grasp = self._beads = None
        replay = state.replay
        if replay is None:
            return
        scene.add_frame("/plan", show_axes=False)
        points, colours = coloured_path(replay)
        self._path = scene.add_line_segments(PATH, scaled(points), colors=colours, thickness=3.0, thickness_units="screen")
        self._build_grasp(state)
        beads = clearance_beads(replay)
        if beads is not None:
            self._beads = scene.add_point_cloud(
                BEADS, scaled(beads[0]), beads[1], point_size=0.06, point_shape="circle", precision="float32"
            )

    def _build_grasp(self, state: State) -> None:
        self._carry = state.carry
        self._server.scene.remove_by_name(GRASP)
        self._grasp = add_grasp(self._server.scene, self._carry.grasp) if self._carry is not None else None

    def _show(self, state: State) -> None:
        """The grasp stays on the part wherever the timeline has it."""
        replay = state.replay
        if self._grasp is not None and replay is not None:
            place(self._grasp, replay.at(state.session.view.time_s).T_world_part)
        hidden = state.session.view.hidden_layers
        for handle, layer in ((self._path, "hand path"), (self._grasp, "grasp"), (self._beads, "clearance")):
            if handle is not None and handle.visible != (layer not in hidden):
                handle.visible = layer not in hidden


def coloured_path(replay: Replay) -> tuple[NDArray, NDArray]:
    """Segments (n, 2, 3) [m] of the fingertips' path and their colours (n, 2, 3)."""
    points = replay.hand_path(SAMPLES)
    times = np.linspace(0.0, replay.duration, SAMPLES)
    kinds = [replay.plan.steps[replay.step_at(t)].kind for t in times[:-1]]
    colours = np.array([palette.STEP_COLOURS[kind] for kind in kinds], dtype=np.uint8)
    return np.stack([points[:-1], points[1:]], axis=1), np.repeat(colours[:, None], 2, axis=1)


def clearance_beads(replay: Replay) -> tuple[NDArray, NDArray] | None:
    """Points (n, 3) [m] along the fingertips' path and their colours (n, 3) by how near anything comes to the arm while it is there."""
    times = np.linspace(0.0, replay.duration, SAMPLES)
    told = [replay.clearance(t) for t in times]
    if None in told:
        return None
    return replay.hand_path(SAMPLES), palette.clearance_colours(np.array(told, dtype=float) / TOLD_M)


def add_grasp(scene: viser.SceneApi, grasp: GraspChoice) -> viser.FrameHandle:
    """Below a frame of the part: the outline where the grasped faces face each other, and, thicker, the edge that is crossed first."""
    frame = scene.add_frame(GRASP, show_axes=False)
    if len(grasp.contact_part) > 1:
        loop = np.stack([grasp.contact_part, np.roll(grasp.contact_part, -1, axis=0)], axis=1)
        scene.add_line_segments(f"{GRASP}/contact", scaled(loop), colors=palette.TEAL, thickness=3.0, thickness_units="screen")
    edge = scaled(grasp.edge_part)[None]
    scene.add_line_segments(f"{GRASP}/first_edge", edge, colors=palette.VERMILLION, thickness=6.0, thickness_units="screen")
    return frame


def _looks(state: State) -> tuple:
    return id(state.session.result), state.session.view.time_s, state.session.view.hidden_layers
