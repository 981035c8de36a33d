"""Located parts as solid bodies with their edges; the part that a plan moves goes where the timeline says."""

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.ruler import ClickPart
from handey_studio.app.scene.units import place, scaled
from handey_studio.app.state import State
from handey_studio.app.wire import Send, on_click
from handey_studio.world import Part

ROOT = "/parts"


def add_solid(
    scene: viser.SceneApi, name: str, part: Part, colour: palette.RGB, T: NDArray, opacity: float | None = None
) -> tuple[viser.FrameHandle, viser.MeshHandle]:
    """A frame at a pose with a part's faces and sharp edges below it; the frame and the faces."""
    frame = scene.add_frame(name, show_axes=False)
    place(frame, T)
    solid = part.solid
    corners = solid.vertices[solid.triangles].reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    mesh = scene.add_mesh_simple(
        f"{name}/faces", scaled(corners), faces, color=colour, opacity=opacity, side="double" if opacity else "front"
    )
    edges = np.array([[solid.vertices[edge.start], solid.vertices[edge.end]] for edge in solid.edges])
    dark = (int(0.55 * colour[0]), int(0.55 * colour[1]), int(0.55 * colour[2]))
    scene.add_line_segments(f"{name}/edges", scaled(edges), colors=dark, thickness=1.5, thickness_units="screen")
    return frame, mesh


class PartsScene:
    """One node for each located instance, and one for the moved part while a plan is looked at."""

    def __init__(self, server: viser.ViserServer, send: Send) -> None:
        self._server, self._send = server, send
        self._frames: dict[str, viser.FrameHandle] = {}
        self._labels: dict[str, viser.LabelHandle] = {}
        self._faces: dict[str, viser.MeshHandle] = {}

    def render(self, old: State | None, new: State) -> None:
        if old is None or old.session.located is not new.session.located:
            self._build(new)
            old = None
        if old is None or _looks(old) != _looks(new):
            self._place(new)

    def _build(self, state: State) -> None:
        for frame in self._frames.values():
            frame.remove()
        scene = self._server.scene
        self._frames, self._labels, self._faces = {}, {}, {}
        for number, placed in enumerate(state.session.located):
            name = f"{ROOT}/{number}"
            self._frames[placed.name], faces = add_solid(scene, name, placed.part, palette.ORANGE, placed.T_world_part)
            self._faces[placed.name] = faces
            on_click(faces, self._send, lambda _, chosen=placed.name: ClickPart(chosen))
            top = placed.part.solid.vertices.mean(axis=0)
            self._labels[placed.name] = scene.add_label(f"{name}/label", placed.name, position=scaled(top), font_screen_scale=0.75)

    def _place(self, state: State) -> None:
        hidden = state.session.view.hidden_layers
        replay, moment = state.replay, state.moment
        for placed in state.session.located:
            played = moment if replay is not None and replay.plan.part == placed.name else None
            T = placed.T_world_part if played is None else played.T_world_part
            moved = not np.allclose(T, placed.T_world_part, atol=1e-6)
            place(self._frames[placed.name], T)
            self._frames[placed.name].visible = "located parts" not in hidden and not (played is not None and played.lost)
            self._faces[placed.name].visible = moved or state.hypothesis is None  # readings are looked at beneath those that stand
            self._labels[placed.name].visible = "labels" not in hidden and state.hypothesis is None


def _looks(state: State) -> tuple:
    view = state.session.view
    return id(state.replay), view.time_s, view.hidden_layers, state.hypothesis is None
