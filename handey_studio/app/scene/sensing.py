"""What localization saw: data edges on the depth map, by kind, and the one that is looked at."""

import numpy as np
import viser

from handey_studio.app import html, palette
from handey_studio.app.browsing import edges_shown
from handey_studio.app.looking_at import PointAt
from handey_studio.app.scene.units import metres, scaled
from handey_studio.app.state import State
from handey_studio.app.wire import Send, on_scene_click
from handey_studio.localization import DataEdge

EDGES, CHOSEN = "/sensed/edges", "/sensed/chosen_edge"
LIFT_M = np.array([0.0, 0.0, 0.002])  # drawn just above the readings, not among them
KIND_COLOURS = {"jump": palette.JUMP, "convex": palette.CONVEX, "concave": palette.CONCAVE}


class SensingScene:
    """The data edges that are long enough as thin lines, the chosen one thick with its kind and length."""

    def __init__(self, server: viser.ViserServer, send: Send) -> None:
        self._scene = server.scene
        on_scene_click(server, send, lambda event: PointAt(metres(event.ray_origin), np.array(event.ray_direction)))

    def render(self, old: State | None, new: State) -> None:
        if old is None or _shown(old) != _shown(new):
            self._draw_edges(new)
        if old is None or _shown(old) != _shown(new) or old.session.view.edge != new.session.view.edge:
            self._draw_chosen(new)

    def _draw_edges(self, state: State) -> None:
        self._scene.remove_by_name(EDGES)
        known = state.session.scene.located.edges if state.session.scene else ()
        edges = [known[k] for k in edges_shown(state)]
        if edges:
            ends = np.array([edge.ends_world for edge in edges]) + LIFT_M
            colours = np.array([KIND_COLOURS.get(edge.kind, palette.GREY) for edge in edges], dtype=np.uint8)
            colours = np.repeat(colours[:, None], 2, axis=1)
            self._scene.add_line_segments(EDGES, scaled(ends), colors=colours, thickness=2.5, thickness_units="screen")

    def _draw_chosen(self, state: State) -> None:
        self._scene.remove_by_name(CHOSEN)
        edge = chosen_edge(state)
        if edge is None:
            return
        ends = edge.ends_world + 2 * LIFT_M
        self._scene.add_frame(CHOSEN, show_axes=False)
        colour = KIND_COLOURS.get(edge.kind, palette.GREY)
        self._scene.add_line_segments(f"{CHOSEN}/line", scaled(ends)[None], colors=colour, thickness=7.0, thickness_units="screen")
        words = f"{edge.kind} edge, {html.millimetres(edge.length, 1)}"
        where = scaled(ends.mean(axis=0))
        self._scene.add_label(f"{CHOSEN}/label", words, position=where, font_screen_scale=0.8, anchor="bottom-center")


def chosen_edge(state: State) -> DataEdge | None:
    """The data edge that is looked at."""
    number = state.session.view.edge
    return state.session.scene.located.edges[number] if state.session.scene and number in edges_shown(state) else None


def _shown(state: State) -> tuple:
    return id(state.session.scene), state.edge_min_m, "data edges" in state.session.view.hidden_layers
