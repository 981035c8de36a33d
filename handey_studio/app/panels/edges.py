"""The edges of the depth map: their kinds with counts, a filter by length, one to read about, and what became of their pairs."""

from typing import Any

import viser

from handey_studio.app import html, palette
from handey_studio.app.browsing import edges_shown
from handey_studio.app.looking_at import FilterEdges, Select
from handey_studio.app.panels.move import choose
from handey_studio.app.scene.sensing import KIND_COLOURS, chosen_edge
from handey_studio.app.state import State
from handey_studio.app.wire import Send, on_user, set_to
from handey_studio.session import Session

NOTHING = "No edges yet. Plan or MOVE scans the table; the depth map's jump, convex and concave edges then show here and in the scene."
NO_EDGES = "The depth map shows no straight edge: nothing stands on the table, or nothing was read."
MEANING = {"jump": "the depth falls away", "convex": "two faces meet outwards", "concave": "two faces meet inwards"}
NONE = "none"
SLIDER_MAX_MM = 100


class EdgesPanel:
    """Legend, slider, list, and numbers."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._legend = gui.add_html("")
        self._least = gui.add_slider("At least (mm)", 0, SLIDER_MAX_MM, 1, 0, hint="Shorter data edges are not shown")
        self._edge: Any = gui.add_dropdown("Data edge", (NONE,), hint="Or click one in the scene")
        self._about = gui.add_html("")
        on_user(self._least, send, lambda event: FilterEdges(event.target.value / 1e3))
        on_user(self._edge, send, lambda event: Select("edge", number_of(event.target.value)))

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        scene = new.session.scene
        some = scene is not None and bool(scene.located.edges)
        labels = edge_labels(new)
        choose(self._edge, labels, next((label for label in labels if number_of(label) == new.session.view.edge), NONE), not some)
        longest = max((1e3 * edge.length for edge in scene.located.edges), default=1.0) if scene else 1.0
        set_to(self._least, max=max(int(longest), 1), value=min(round(1e3 * new.edge_min_m), max(int(longest), 1)), visible=some)
        set_to(self._edge, visible=some)
        if not some:
            self._legend.content = html.empty(NOTHING if scene is None else NO_EDGES, "edges-empty")
            self._about.content = ""
        else:
            self._legend.content = edges_legend(new)
            self._about.content = about_edge(new) + fallen_html(new.session)


def number_of(label: str) -> int:
    """The number in a label such as `3: jump, 42 mm`; -1 for none."""
    return -1 if label == NONE else int(label.split(":")[0])


def edge_labels(state: State) -> tuple[str, ...]:
    """The data edges that are long enough, by number, kind and length."""
    scene = state.session.scene
    edges = scene.located.edges if scene else ()
    return (NONE, *(f"{k}: {edges[k].kind}, {1e3 * edges[k].length:.0f} mm" for k in edges_shown(state)))


def edges_legend(state: State) -> str:
    """Each kind with its colour, what it is, and how many are shown of how many."""
    scene = state.session.scene
    edges = scene.located.edges if scene else ()
    shown = [edges[k] for k in edges_shown(state)]
    rows = ""
    for kind, colour in KIND_COLOURS.items():
        count, total = (sum(edge.kind == kind for edge in some) for some in (shown, edges))
        of = "" if count == total else f" of {total}"
        line = f'<span style="width:22px;height:4px;border-radius:2px;background:{palette.text(colour)}"></span>'
        words = f'<b style="font-weight:600">{count}{of} {kind}</b><span style="color:var(--muted)">{MEANING[kind]}</span>'
        rows += f'<div style="display:flex;align-items:center;gap:8px">{line}{words}</div>'
    return f'<div data-testid="edges" style="margin:6px 14px;font-size:12.5px;line-height:1.6">{rows}</div>'


def about_edge(state: State) -> str:
    """The chosen edge in numbers."""
    edge = chosen_edge(state)
    if edge is None:
        return html.empty("Click an edge in the scene, or choose one above, to read about it.", "edge-none")
    users = [
        f"{number + 1}"
        for number, h in enumerate(state.session.scene.located.hypotheses if state.session.scene else ())
        if state.session.view.edge in h.data
    ]
    surfaces = "both its faces are seen" if len(edge.normals_sensor) > 1 else "one face beside it is seen"
    rows = [
        ("Kind", f"{edge.kind}: {MEANING.get(edge.kind, '')}, {surfaces}"),
        ("Length", html.millimetres(edge.length, 1)),
        ("Fitted to", f"{edge.pixels} pixels, {1e3 * edge.rms:.2f} mm rms off the line"),
        ("Hypotheses", f"number {', '.join(users[:12])}{' …' if len(users) > 12 else ''}" if users else "none came from it"),
    ]
    return html.facts(rows, "edge")


def fallen_html(session: Session) -> str:
    """How many assignments of data edges to model edges fell by each of Figure 3's parameters."""
    fell = session.scene.located.fell if session.scene else {}
    if not fell:
        return ""
    most = max(fell.values())
    bars = "".join(html.count_row(reason, count, most, palette.GREY) for reason, count in sorted(fell.items(), key=lambda item: -item[1]))
    head = '<div style="font-weight:650;margin:8px 0 2px">Pairs of edges that did not fit a pair of the model</div>'
    return f'<div data-testid="fell" style="margin:4px 14px;font-size:12px;line-height:1.4">{head}{bars}</div>'


def _looks(state: State) -> tuple:
    view = state.session.view
    return state.loads, id(state.session.scene), view.edge, state.edge_min_m, "data edges" in view.hidden_layers
