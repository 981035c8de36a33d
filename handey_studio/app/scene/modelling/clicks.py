"""Clicks into the model's scene: what they went to, what is selected, the outline that is being drawn, and what was measured."""

from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.modelling import derived
from handey_studio.app.modelling.look import POINTS, Drawing
from handey_studio.app.modelling.plane_tools import measurement, tool_plane
from handey_studio.app.modelling.tool_clicks import CUT, MIRROR
from handey_studio.app.modelling.tools import ClickScene
from handey_studio.app.scene.modelling.solid import face_corners
from handey_studio.app.scene.units import metres, scaled
from handey_studio.app.state import State
from handey_studio.app.wire import Send, on_scene_click
from handey_studio.base import measured
from handey_studio.geometry.transforms import apply
from handey_studio.modeling.picking.snap import MODEL, Ray, Snap
from handey_studio.modeling.sketch_plane import sketch_plane

ROOT = "/model/clicks"
DOT_M = 0.0016
PLANE_HALF_M = 0.06


class ClickScenes:
    """Dots where clicks went, named; the faces and edges that are selected; the sketch with its constraints."""

    def __init__(self, server: viser.ViserServer, send: Send) -> None:
        self._scene = server.scene
        on_scene_click(server, send, lambda event: ClickScene(ray_of(event)))
        on_scene_click(server, send, lambda event: ClickScene(ray_of(event), add=True), "shift")

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        self._scene.remove_by_name(ROOT)
        if derived.draft_of(new) is None:
            return
        self._scene.add_frame(ROOT, show_axes=False)
        for number, snap in enumerate((*new.model.picked, *new.model.clicks)):
            self._add_snap(f"{ROOT}/snap{number}", snap, new, f"{number // 2 + 1}" if new.model.tool == POINTS else snap.of)
        if new.model.drawing is not None:
            self._add_drawing(new.model.drawing)
        self._add_sketches(new)
        self._add_plane(new)
        self._add_measure(new)

    def _add_snap(self, name: str, snap: Snap, state: State, words: str) -> None:
        self._dot(name, snap.point)
        self._label(f"{name}_label", snap.point, words)
        shown = derived.built(state)
        if snap.owner != MODEL or shown is None or shown.solid is None:
            return
        if snap.kind == "plane" and snap.number < len(shown.solid.faces):
            corners = face_corners(shown.solid, [snap.number]) + 2e-4 * snap.normal
            numbers = np.arange(len(corners)).reshape(-1, 3)
            self._scene.add_mesh_simple(f"{name}_face", scaled(corners), numbers, color=palette.BLUE, opacity=0.55, side="double")
        elif snap.kind == "edge" and snap.number < len(shown.solid.edges):
            edge = shown.solid.edges[snap.number]
            self._lines(f"{name}_edge", shown.solid.vertices[[edge.start, edge.end]][None], palette.BLUE, 6.0)

    def _add_drawing(self, drawing: Drawing) -> None:
        """The outline so far, each side with what it was taken to mean."""
        T, stroke = drawing.T_model_plane, drawing.stroke
        half = PLANE_HALF_M * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
        square = apply(T, half)
        self._lines(f"{ROOT}/plane", np.stack([square, np.roll(square, -1, axis=0)], axis=1), palette.PALE_SKY, 1.0)
        corners = apply(T, np.c_[stroke.corners, np.zeros(len(stroke.corners))]) if len(stroke.clicks) else np.empty((0, 3))
        for number, corner in enumerate(corners):
            self._dot(f"{ROOT}/corner{number}", corner)
        if len(corners) > 1:
            self._lines(f"{ROOT}/sides", np.stack([corners[:-1], corners[1:]], axis=1), palette.BLUE, 3.5)
        for side in range(len(corners) - 1):
            meant = [c for c in stroke.constraints if c.on and c.item == side and c.kind not in ("at", "on line")]
            words = " ".join(c.told.removesuffix("horizontal").removesuffix("vertical").strip() for c in meant)
            length = float(np.linalg.norm(corners[side + 1] - corners[side]))
            self._label(f"{ROOT}/side{side}", (corners[side] + corners[side + 1]) / 2.0, f"{1e3 * length:.1f} mm {words}".strip())

    def _add_sketches(self, state: State) -> None:
        shown = derived.built(state)
        for number, sketch in enumerate(shown.sketches if shown is not None else ()):
            corners = apply(sketch.T_model_plane, np.c_[sketch.outline.corners, np.zeros(len(sketch.outline.corners))])
            self._lines(f"{ROOT}/sketch{number}", np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), palette.BLUE, 3.0)

    def _add_plane(self, state: State) -> None:
        """The plane that would cut or mirror, with an arrow to the side that its normal points to."""
        plane = tool_plane(state) if state.model.tool in (CUT, MIRROR) else None
        if plane is None:
            return
        point, normal = plane
        corners = apply(sketch_plane(point, normal), PLANE_HALF_M * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]))
        faces = np.array([[0, 1, 2], [0, 2, 3]])
        self._scene.add_mesh_simple(f"{ROOT}/cut", scaled(corners), faces, color=palette.VERMILLION, opacity=0.35, side="double")
        self._lines(f"{ROOT}/normal", np.array([[point, point + 0.02 * normal]]), palette.VERMILLION, 4.0)

    def _add_measure(self, state: State) -> None:
        told = measurement(state)
        if told is not None:
            self._lines(f"{ROOT}/measure", told.line[None], palette.VERMILLION, 3.0)
            self._label(f"{ROOT}/measured", told.line.mean(axis=0), measured(told.value, told.unit))

    def _dot(self, name: str, point: NDArray) -> None:
        self._scene.add_icosphere(name, radius=float(scaled(DOT_M)), color=palette.BLUE, position=scaled(point), subdivisions=2)

    def _label(self, name: str, point: NDArray, words: str) -> None:
        self._scene.add_label(name, words, position=scaled(point), font_screen_scale=0.8, anchor="bottom-center")

    def _lines(self, name: str, ends: NDArray, colour: palette.RGB, width: float) -> None:
        self._scene.add_line_segments(name, scaled(ends), colors=colour, thickness=width, thickness_units="screen")


def ray_of(event: Any) -> Ray:
    """The line of sight of a click."""
    camera = event.client.camera
    pixel = 2.0 * float(np.tan(camera.fov / 2.0)) / max(int(camera.image_height), 1)
    return Ray(metres(event.ray_origin), np.array(event.ray_direction, dtype=float), pixel)


def _looks(state: State) -> tuple:
    look, shown = state.model, derived.built(state)
    clicked = id(look.clicks), id(look.picked), id(look.drawing)
    return state.loads, shown is None, look.tool, *clicked, look.settings, shown and (shown.sketches, id(shown.solid))
