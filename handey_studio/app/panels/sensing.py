"""What was located: the parts found, then every hypothesis in a list to browse, and what speaks for and against the one looked at."""

from collections.abc import Sequence
from typing import Any

import viser
from numpy.typing import NDArray

from handey_studio.app import html
from handey_studio.app.browsing import ROWS, browsed_hypotheses, page_of
from handey_studio.app.looking_at import Browse, BrowseRow, FilterHypotheses, LookAt
from handey_studio.app.panels.explained import explained_html
from handey_studio.app.panels.move import choose
from handey_studio.app.panels.rows import could_also_be, hypothesis_rows
from handey_studio.app.state import State
from handey_studio.app.viewpoints import Follow, LookFrom
from handey_studio.app.wire import Send, element_id, on_click, on_user, set_to
from handey_studio.geometry.transforms import to_xyz_rpy
from handey_studio.session import Session
from handey_studio.session.looking import tally

NOTHING = "Nothing was scanned yet. Plan or MOVE scans the table first, and shows here what was found in the depth map."
NO_PAIRS = "No pair of data edges fits a pair of the parts' edges, so there was no hypothesis. Edges, on the left, shows what was seen."
BACK, ON, CLOSE, AWAY = "◀ Prev", "Next ▶", "Close up", "Clear"
PRESSED = {BACK: Browse(-1), ON: Browse(1), AWAY: LookAt(-1)}


class SensingPanel:
    """Poses found, a filter, the list with its buttons, and the hypothesis that is looked at."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        self._found = gui.add_html("")
        self._part: Any = gui.add_dropdown("Of part", ("all",), hint="Hypotheses of one part only")
        self._verdict: Any = gui.add_dropdown("Verdict", ("all",), hint="Accepted, or fallen for one reason")
        self._list = gui.add_html("")
        self._rows = [gui.add_button(f"Hypothesis in row {row + 1}") for row in range(ROWS)]  # pressed by the list, which hides them
        self._browse = gui.add_button_group("Look at", (BACK, ON, CLOSE, AWAY), hint="Keys: N next, B the one before, 6 close up")
        self._about = gui.add_html("")
        on_user(self._part, send, lambda event: FilterHypotheses(part=word_of(event.target.value)))
        on_user(self._verdict, send, lambda event: FilterHypotheses(verdict=word_of(event.target.value)))
        for row, button in enumerate(self._rows):
            on_click(button, send, lambda event, row=row: Follow(BrowseRow(row), event.client_id))
        on_click(self._browse, send, _pressed)

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        scene = new.session.scene
        listed = browsed_hypotheses(new)
        parts, verdicts = tally(scene)
        choose(self._part, counted(parts), picked(counted(parts), new.hypothesis_part), scene is None)
        choose(self._verdict, counted(verdicts), picked(counted(verdicts), new.hypothesis_verdict), scene is None)
        for widget in (self._part, self._verdict, self._browse):
            set_to(widget, visible=scene is not None and bool(scene.located.hypotheses))
        self._found.content = html.empty(NOTHING, "sensing-empty") if scene is None else found_html(new.session)
        if scene is None:
            self._list.content = html.hidden([element_id(button) for button in self._rows])
            self._about.content = ""
            return
        self._list.content = hypothesis_rows(scene, page_of(new), listed, new.session.view.hypothesis, [element_id(b) for b in self._rows])
        self._about.content = explained_html(new) if scene.located.hypotheses else html.empty(NO_PAIRS, "hypotheses-empty")


def _pressed(event: Any) -> Any:
    if event.target.value == CLOSE:
        return LookFrom("Hypothesis", event.client_id)
    return Follow(PRESSED[event.target.value], event.client_id)


def counted(counts: dict[str, int]) -> tuple[str, ...]:
    """Words with how often they occur, after one for all."""
    return (f"all ({sum(counts.values())})", *(f"{word} ({count})" for word, count in counts.items()))


def word_of(label: str) -> str:
    """The word in a label that `counted` made; empty for all."""
    word = label.rsplit(" (", 1)[0]
    return "" if word == "all" else word


def picked(labels: Sequence[str], word: str) -> str:
    """The label of a word, the one for all when it is not there."""
    return next((label for label in labels if word and word_of(label) == word), labels[0])


def found_html(session: Session) -> str:
    """Each instance with its place and what is seen of it."""
    if session.scene is None:
        return ""
    if not session.scene.instances:
        reason = session.scene.located.reason or "No hypothesis passed verification."
        return html.card("No part was found", reason, "bad", "located-none")
    places = {placed.name: _where(placed.T_world_part) for placed in session.scene.instances}
    for placed, pose in zip(session.scene.instances, session.scene.located.poses, strict=False):
        places[placed.name] += f"; {100 * pose.visible_fraction:.0f} % seen, {1e3 * pose.surface_rms_m:.2f} mm rms"
        places[placed.name] += f"; {words}" if (words := could_also_be(pose.part, pose.rivals)) else ""
    for name in places.keys() & set(session.scene.known):
        places[name] += "; known from before, and the readings agree"
    return html.facts(places.items(), "located")


def _where(T: NDArray) -> str:
    return f"at {', '.join(f'{1e3 * x + 0.0:.1f}' for x in to_xyz_rpy(T)[0])} mm"


def _looks(state: State) -> tuple:
    view = state.session.view
    filters = state.hypothesis_part, state.hypothesis_verdict
    return state.loads, id(state.session.scene), view.hypothesis, filters, id(state.explained), id(state.explanation)
