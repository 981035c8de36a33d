"""The hypothesis that is looked at: its body, its predicted edges by state, how far readings lie off it; the others as wires."""

import numpy as np
import viser

from handey_studio.app import palette
from handey_studio.app.browsing import wired
from handey_studio.app.scene.units import place, scaled
from handey_studio.app.state import State
from handey_studio.localization import Hypothesis
from handey_studio.localization.explain import Explanation
from handey_studio.session.looking import wires_of

BODY, EDGES, READINGS, OTHERS = "/hypothesis/body", "/hypothesis/edges", "/hypothesis/readings", "/hypothesis/others"
STATE_COLOURS = (palette.FOUND, palette.MISSING, palette.HIDDEN)
LIFT_M = np.array([0.0, 0.0, 0.0012])  # lines stand just above the readings, not among them


class HypothesisScene:
    """Each piece is drawn anew when what it shows changes."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene
        self._scene.add_frame("/hypothesis", show_axes=False)

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        for name in (BODY, EDGES, READINGS, OTHERS):
            self._scene.remove_by_name(name)
        hypothesis, hidden = new.hypothesis, new.session.view.hidden_layers
        if hypothesis is None:
            return
        self._draw_others(new)
        if "hypothesis" not in hidden:
            self._draw_body(new, hypothesis)
            self._draw_edges(new, hypothesis)
        if "residuals" not in hidden and new.explanation is not None:
            self._draw_readings(new, new.explanation)

    def _draw_others(self, state: State) -> None:
        """Wires of the other hypotheses in the list; a click on one looks at it."""
        scene, parts = state.session.scene, state.session.parts
        numbers = [number for number in wired(state) if number != state.session.view.hypothesis]
        wires = [wires_of(scene.located.hypotheses[number], parts) for number in numbers] if scene else []
        if wires:
            segments = scaled(np.concatenate(wires))
            self._scene.add_line_segments(OTHERS, segments, colors=palette.PALE_SKY, thickness=1.0, thickness_units="screen")

    def _draw_body(self, state: State, hypothesis: Hypothesis) -> None:
        part = state.session.part(hypothesis.part)
        if part is None:
            return
        corners = part.solid.vertices[part.solid.triangles].reshape(-1, 3)
        faces = np.arange(len(corners)).reshape(-1, 3)
        body = self._scene.add_mesh_simple(BODY, scaled(corners), faces, color=palette.SKY, opacity=0.16, side="double")
        place(body, hypothesis.T_world_part)

    def _draw_edges(self, state: State, hypothesis: Hypothesis) -> None:
        """Found, missing and hidden in three colours; in one until that is worked out."""
        said = state.explanation
        if said is None:
            wires = wires_of(hypothesis, state.session.parts)
            colours = np.broadcast_to(np.array(palette.SKY, dtype=np.uint8), (len(wires), 2, 3))
        else:
            wires = said.pieces_world
            colours = np.repeat(np.array(STATE_COLOURS, dtype=np.uint8)[said.state][:, None], 2, axis=1)
        if len(wires):
            self._scene.add_line_segments(EDGES, scaled(wires + LIFT_M), colors=colours, thickness=4.5, thickness_units="screen")

    def _draw_readings(self, state: State, said: Explanation) -> None:
        scan = state.session.scan
        if scan is None or not len(said.distance):
            return
        self._scene.add_point_cloud(
            READINGS,
            scaled(said.readings_world),
            palette.residual_colours(said.distance / said.limit_m),
            point_size=float(scaled(1.15 * scan.cell)),
            point_shape="square",
            precision="float32",
            point_shading="flat",
        )


def _looks(state: State) -> tuple:
    view = state.session.view
    return id(state.session.scene), view.hypothesis, view.hidden_layers, id(state.explanation), wired(state)
