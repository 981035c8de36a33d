"""What localization saw: data edges on the depth map, and the hypothesis that is looked at."""

import numpy as np
import viser

from handey_studio.app import palette
from handey_studio.app.commands import PointAt
from handey_studio.app.scene.parts import add_solid
from handey_studio.app.scene.units import metres, scaled
from handey_studio.app.state import State
from handey_studio.app.wire import Send, on_scene_click
from handey_studio.localization import Hypothesis

EDGES, CHOSEN, HYPOTHESIS = "/sensed/edges", "/sensed/chosen_edge", "/sensed/hypothesis"
LIFT_M = np.array([0.0, 0.0, 0.0012])  # drawn just above the readings, not among them
KIND_COLOURS = {"jump": palette.VERMILLION, "convex": palette.INK, "concave": palette.GREY}


class SensingScene:
    """All data edges as thin lines, the chosen one thick; one hypothesis as a translucent body with the edges that it came from."""

    def __init__(self, server: viser.ViserServer, send: Send) -> None:
        self._server = server
        self._edges: viser.LineSegmentsHandle | None = None
        on_scene_click(server, send, lambda event: PointAt(metres(event.ray_origin), np.array(event.ray_direction)))

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        if old is None or old.session.scene is not new.session.scene:
            self._draw_edges(new)
        self._choose(new)
        self._draw_hypothesis(new)
        self._show(new)

    def _draw_edges(self, state: State) -> None:
        scene = self._server.scene
        scene.remove_by_name("/sensed")
        self._edges = None
        edges = state.session.scene.located.edges if state.session.scene else ()
        if edges:
            scene.add_frame("/sensed", show_axes=False)
            ends = np.array([edge.ends_world for edge in edges]) + LIFT_M
            colours = np.array([KIND_COLOURS.get(edge.kind, palette.GREY) for edge in edges], dtype=np.uint8)
            colours = np.repeat(colours[:, None], 2, axis=1)
            self._edges = scene.add_line_segments(EDGES, scaled(ends), colors=colours, thickness=2.5, thickness_units="screen")

    def _choose(self, state: State) -> None:
        scene = self._server.scene
        scene.remove_by_name(CHOSEN)
        chosen = chosen_edges(state)
        if chosen:
            ends = np.array([edge.ends_world for edge in chosen]) + 2 * LIFT_M
            scene.add_line_segments(CHOSEN, scaled(ends), colors=palette.BLUE, thickness=7.0, thickness_units="screen")

    def _draw_hypothesis(self, state: State) -> None:
        scene = self._server.scene
        scene.remove_by_name(HYPOTHESIS)
        hypothesis = chosen_hypothesis(state)
        part = state.session.part(hypothesis.part) if hypothesis else None
        if hypothesis is not None and part is not None and "hypothesis" not in state.session.view.hidden_layers:
            add_solid(scene, HYPOTHESIS, part, palette.SKY, hypothesis.T_world_part, opacity=0.45)

    def _show(self, state: State) -> None:
        shown = "data edges" not in state.session.view.hidden_layers
        if self._edges is not None and self._edges.visible != shown:
            self._edges.visible = shown


def chosen_hypothesis(state: State) -> Hypothesis | None:
    """The hypothesis that is looked at."""
    scene, number = state.session.scene, state.session.view.hypothesis
    known = scene.located.hypotheses if scene else ()
    return known[number] if 0 <= number < len(known) else None


def chosen_edges(state: State) -> list:
    """The edge that is looked at and those that the chosen hypothesis came from."""
    scene, number = state.session.scene, state.session.view.edge
    edges = scene.located.edges if scene else ()
    hypothesis = chosen_hypothesis(state)
    numbers = {number, *(hypothesis.data if hypothesis else ())}
    return [edges[k] for k in sorted(numbers) if 0 <= k < len(edges)]


def _looks(state: State) -> tuple:
    view = state.session.view
    return id(state.session.scene), view.hypothesis, view.edge, view.hidden_layers
