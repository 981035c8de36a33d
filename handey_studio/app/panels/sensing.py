"""What was located: parts found, hypotheses and data edges to choose from, why the others fell."""

from typing import Any

import viser

from handey_studio.app import html
from handey_studio.app.commands import Select
from handey_studio.app.panels.move import choose
from handey_studio.app.scene.sensing import chosen_edges, chosen_hypothesis
from handey_studio.app.state import State
from handey_studio.app.wire import Send, on_user
from handey_studio.geometry.transforms import to_xyz_rpy
from handey_studio.session import Session

NOTHING = "Nothing was scanned yet. Plan or MOVE scans the table first, and shows here what was found in the depth map."
NONE = "none"


class SensingPanel:
    """Poses found, then one hypothesis or data edge to look at."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._found = gui.add_html("")
        self._hypothesis: Any = gui.add_dropdown("Hypothesis", (NONE,))
        self._edge: Any = gui.add_dropdown("Data edge", (NONE,))
        self._about = gui.add_html("")
        on_user(self._hypothesis, send, lambda event: Select("hypothesis", number_of(event.target.value)))
        on_user(self._edge, send, lambda event: Select("edge", number_of(event.target.value)))

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        view = new.session.view
        hypotheses, edges = hypothesis_labels(new.session), edge_labels(new.session)
        empty = new.session.scene is None
        choose(self._hypothesis, hypotheses, picked(hypotheses, view.hypothesis), empty)
        choose(self._edge, edges, picked(edges, view.edge), empty)
        self._found.content = html.empty(NOTHING, "sensing-empty") if empty else found_html(new.session)
        self._about.content = about_html(new)


def number_of(label: str) -> int:
    """The number in a label such as `3: l_block, 0.93`; -1 for none."""
    return -1 if label == NONE else int(label.split(":")[0])


def picked(labels: tuple[str, ...], number: int) -> str:
    """The label of a number, which is none when it is out of range."""
    return labels[number + 1] if -1 <= number < len(labels) - 1 else NONE


def hypothesis_labels(session: Session) -> tuple[str, ...]:
    known = session.scene.located.hypotheses if session.scene else ()
    return (NONE, *(f"{k}: {h.part}, {h.score:.2f}{'' if h.reason else ' accepted'}" for k, h in enumerate(known)))


def edge_labels(session: Session) -> tuple[str, ...]:
    edges = session.scene.located.edges if session.scene else ()
    return (NONE, *(f"{k}: {edge.kind}, {1e3 * edge.length:.0f} mm" for k, edge in enumerate(edges)))


def found_html(session: Session) -> str:
    """Each instance with its pose, score and evidence; the reasons by which assignments fell."""
    if session.scene is None:
        return ""
    located = session.scene.located
    pane = ""
    for placed, pose in zip(session.scene.instances, located.poses, strict=False):
        xyz, _ = to_xyz_rpy(placed.T_world_part)
        where = ", ".join(f"{1e3 * x:.1f}" for x in xyz)
        evidence = f"{pose.edges_found} of {pose.edges_predicted} edges, {100 * pose.visible_fraction:.0f} % seen, "
        evidence += f"{1e3 * pose.surface_rms_m:.2f} mm rms"
        pane += html.card(f"{placed.name}, score {pose.score:.2f}", f"at {where} mm; {evidence}", "good", "located")
    if not session.scene.instances:
        pane += html.card("No part was found", located.reason or "No hypothesis passed verification.", "bad", "located-none")
    return pane


def about_html(state: State) -> str:
    """The chosen hypothesis and edge in words; then how many assignments fell for which reason."""
    scene = state.session.scene
    if scene is None:
        return ""
    rows = []
    hypothesis = chosen_hypothesis(state)
    if hypothesis is not None:
        verdict = f"fell: {hypothesis.reason}" if hypothesis.reason else "accepted"
        lengths = f"{html.millimetres(hypothesis.found_m)} of edge found, {html.millimetres(hypothesis.missing_m)} missing"
        rows += [("Hypothesis", verdict), ("Evidence", lengths), ("From data edges", ", ".join(map(str, hypothesis.data)))]
    for edge in chosen_edges(state):
        rows.append(
            ("Data edge", f"{edge.kind}, {html.millimetres(edge.length, 1)}, {edge.pixels} pixels, {1e3 * edge.rms:.2f} mm off the line")
        )
    rows += [(f"{count} ×", reason) for reason, count in list(scene.located.rejected.items())[:10]]
    return html.facts(rows, "sensing-about")


def _looks(state: State) -> tuple:
    view = state.session.view
    return state.loads, id(state.session.scene), view.hypothesis, view.edge
