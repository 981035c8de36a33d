"""The grasp in the scene: its faces and first edge on the part, and, for a cell of the grasp–placement table, part and hand as ghosts."""

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.grasp_commands import looked_at, standing_pose
from handey_studio.app.scene.parts import add_solid
from handey_studio.app.scene.units import SCALE, place, scaled
from handey_studio.app.state import State
from handey_studio.task.plan import Carry, GraspChoice
from handey_studio.world import Hand

GRASP, STANDING = "/grasp", "/standing"
PART_OPACITY, HAND_OPACITY = 0.45, 0.8


class GraspScene:
    """The grasp of the carry that the timeline is in; it stays on the part wherever that is."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene
        self._carry: Carry | None = None
        self._grasp: viser.FrameHandle | None = None

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        if self._carry is not new.carry:
            self._carry = new.carry
            self._scene.remove_by_name(GRASP)
            self._grasp = add_grasp(self._scene, self._carry.grasp) if self._carry is not None else None
        if self._grasp is not None and new.replay is not None:
            place(self._grasp, new.replay.at(new.session.view.time_s).T_world_part)
            self._grasp.visible = "grasp" not in new.session.view.hidden_layers


class StandingScene:
    """The part as the row that is looked at has it, and the hand as the column has it: teal if legal, red if not."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene

    def render(self, old: State | None, new: State) -> None:
        look = looked_at(new)
        if old is not None and looked_at(old) == look and old.handling is new.handling:
            return
        self._scene.remove_by_name(STANDING)
        told, pose = new.handling, standing_pose(new)
        if told is None or pose is None or look.row is None:
            return
        add_solid(self._scene, STANDING, told.part, palette.ORANGE, pose, PART_OPACITY)
        if look.column is not None:
            colour = palette.TEAL if told.legal(look.row)[look.column] else palette.VERMILLION
            T, opening = told.table.Ts_part_hand[look.column], float(told.table.openings[look.column])
            add_hand(self._scene, f"{STANDING}/hand", new.robot.hand, T, opening, colour)


def add_hand(scene: viser.SceneApi, name: str, hand: Hand, T: NDArray, opening: float, colour: palette.RGB) -> None:
    """The hand's boxes below a frame at a pose."""
    place(scene.add_frame(name, show_axes=False), T)
    for box, (lower, upper) in hand.boxes(opening).items():
        size, middle = tuple(np.asarray(upper - lower) * SCALE), (lower + upper) / 2.0 * SCALE
        scene.add_box(f"{name}/{box}", color=colour, dimensions=size, position=middle, opacity=HAND_OPACITY)


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
    return id(state.carry), state.session.view.time_s, state.session.view.hidden_layers
