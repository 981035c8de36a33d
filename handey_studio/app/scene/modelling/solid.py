"""The solid that is modelled, or suggested: faces that were seen in full colour, those that are assumed paler and hatched."""

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.modelling import derived
from handey_studio.app.scene.units import scaled
from handey_studio.app.state import State
from handey_studio.geometry import Polyhedron
from handey_studio.geometry.transforms import apply
from handey_studio.localization import LocateResult
from handey_studio.session.model_look import assumed_faces, hatching

ROOT = "/model/solid"
OPACITY, PALE_OPACITY = 0.72, 0.22


class SolidScene:
    """The model after the step that is looked at; while a new one is suggested, that one."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene

    def render(self, old: State | None, new: State) -> None:
        solid, sources, suggested = shown_solid(new)
        if old is not None and _looks(old) == _looks(new):
            return
        self._scene.remove_by_name(ROOT)
        found = derived.tried(new)
        if solid is None or (new.model.trial is not None and found is None):
            return
        if new.model.trial is not None and found is not None:
            self._add_found(solid, found)
            return
        assumed = assumed_faces(sources)
        colour = palette.SKY if suggested else palette.ORANGE
        checked = _of_check(new)
        self._add_faces(f"{ROOT}/seen", solid, [f for f in range(len(solid.faces)) if f not in (*assumed, *checked)], colour, OPACITY)
        self._add_faces(f"{ROOT}/assumed", solid, [f for f in assumed if f not in checked], colour, PALE_OPACITY)
        self._add_faces(f"{ROOT}/wrong", solid, list(checked), palette.VERMILLION, OPACITY)
        dark = (colour[0] // 2, colour[1] // 2, colour[2] // 2)
        self._add_edges(f"{ROOT}/edges", solid, dark)
        lines = hatching(solid, assumed)
        if len(lines):
            self._scene.add_line_segments(f"{ROOT}/hatching", scaled(lines), colors=dark, thickness=1.0, thickness_units="screen")

    def _add_found(self, solid: Polyhedron, found: LocateResult) -> None:
        """The solid wherever it was found in the scan that it was looked for in, with its probability."""
        for number, pose in enumerate(found.poses):
            moved = Polyhedron(apply(pose.T_world_part, solid.vertices), solid.faces)
            self._add_faces(f"{ROOT}/found{number}", moved, list(range(len(solid.faces))), palette.ORANGE, OPACITY)
            self._add_edges(f"{ROOT}/found{number}_edges", moved, palette.EDGE)
            words, top = f"{100 * pose.score:.0f} %", moved.vertices[int(np.argmax(moved.vertices[:, 2]))]
            self._scene.add_label(f"{ROOT}/found{number}_label", words, position=scaled(top), font_screen_scale=0.9, anchor="bottom-center")

    def _add_edges(self, name: str, solid: Polyhedron, colour: palette.RGB) -> None:
        edges = np.array([[solid.vertices[edge.start], solid.vertices[edge.end]] for edge in solid.edges])
        self._scene.add_line_segments(name, scaled(edges), colors=colour, thickness=2.5, thickness_units="screen")

    def _add_faces(self, name: str, solid: Polyhedron, faces: list[int], colour: palette.RGB, opacity: float) -> None:
        corners = face_corners(solid, faces)
        if len(corners):
            numbers = np.arange(len(corners)).reshape(-1, 3)
            self._scene.add_mesh_simple(name, scaled(corners), numbers, color=colour, opacity=opacity, side="double", flat_shading=True)


def shown_solid(state: State) -> tuple[Polyhedron | None, tuple[str, ...], bool]:
    """The solid that stands in the scene, what its faces rest on, and whether it is only suggested."""
    suggestion, shown = derived.suggestion(state), derived.built(state)
    if state.model.preview is not None and shown is not None:
        same = len(state.model.preview.faces) == len(shown.sources)
        return state.model.preview, shown.sources if same else (), False
    if suggestion is not None and suggestion.solid is not None and state.model.step is None:
        return suggestion.solid, suggestion.sources, True
    return (None, (), False) if shown is None else (shown.solid, shown.sources, False)


def face_corners(solid: Polyhedron, faces: list[int]) -> NDArray:
    """Corners (3 n, 3) [m] of the triangles of some faces."""
    return solid.vertices[solid.triangles[np.isin(solid.face_of_triangle, faces)]].reshape(-1, 3)


def _of_check(state: State) -> tuple[int, ...]:
    """The faces of the check that is pointed at."""
    judged = derived.truth(state)
    return judged.findings[state.model.check].faces if judged is not None and 0 <= state.model.check < len(judged.findings) else ()


def _looks(state: State) -> tuple:
    solid, sources, suggested = shown_solid(state)
    trial = id(state.model.trial), id(derived.tried(state))
    return *trial, state.loads, id(solid), sources, suggested, state.model.check, id(derived.truth(state)) if state.model.check >= 0 else 0
