"""What the localizer saw and weighed, looked at in a real browser: by row, by key, by a click into the scene."""

import time

import numpy as np

from handey_studio.app.browsing import edges_shown
from handey_studio.session.looking import wires_of
from tests.browser.conftest import ARTEFACTS, LARGE
from tests.browser.hands import pane, press, wait_until
from tests.browser.test_workbench import pixel_of
from tests.session.samples import full_session


def test_hypotheses_are_looked_at_by_row_key_and_wire(studio, visit, tmp_path):
    workbench = studio(full_session(tmp_path))
    page = visit(workbench, viewport=LARGE)
    page.get_by_role("tab", name="Located").click()
    pane(page, "hypothesis-1").click()
    wait_until(lambda: workbench.state.session.view.hypothesis == 1)
    wait_until(lambda: "too few edges found" in pane(page, "hypothesis").inner_text())
    pane(page, "explanation").wait_for(timeout=300_000)  # compiled for the first time, perhaps, while others compile
    assert "within the limit" in pane(page, "explanation").inner_text() and "Hypothesis in row" not in page.inner_text("body")
    page.keyboard.press("b")
    wait_until(lambda: workbench.state.session.view.hypothesis == 0)
    wait_until(lambda: "/pair/α" in workbench.server.scene._handle_from_node_name)
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    press(page, "Close up")
    time.sleep(4.0)
    page.screenshot(path=ARTEFACTS / "hypothesis.png")
    _click_a_wire(page, workbench, 1)
    page.get_by_role("tab", name="Edges").click()
    page.get_by_role("slider").first.focus()
    page.keyboard.press("End")
    wait_until(lambda: len(edges_shown(workbench.state)) == 1)
    wait_until(lambda: "1 of 2 jump" in pane(page, "edges").inner_text())
    page.keyboard.press("0")
    wait_until(lambda: workbench.state.hypothesis is None and not workbench.state.undo)
    _measure(page, workbench)


def _measure(page, workbench) -> None:
    """The ruler laid between two spots in the middle of the view."""
    middle = workbench.state.session.view.camera_look_at
    page.get_by_role("tab", name="View").click()
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("r")
    wait_until(lambda: workbench.state.ruler == ())
    for count, along in enumerate((0.0, 0.02), 1):
        page.mouse.click(*pixel_of(page, workbench, 10.0 * (middle + np.array([along, 0.0, 0.0]))))
        wait_until(lambda count=count: len(workbench.state.ruler) == count)
    pane(page, "ruler").get_by_text("mm apart").wait_for()
    page.keyboard.press("Escape")
    wait_until(lambda: workbench.state.ruler is None)


def _click_a_wire(page, workbench, number: int) -> None:
    """Click the wires of a hypothesis, one after the other, until one is not covered by another's."""
    wires = wires_of(workbench.state.session.scene.located.hypotheses[number], workbench.state.session.parts)
    for wire in wires:
        page.mouse.click(*pixel_of(page, workbench, 10.0 * (0.7 * wire[0] + 0.3 * np.asarray(wire[1]))))
        time.sleep(0.5)
        if workbench.state.session.view.hypothesis == number:
            return
    raise AssertionError("no click on a wire looked at its hypothesis")
