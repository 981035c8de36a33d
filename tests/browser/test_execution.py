"""Execution in a real browser: what really happened is played and told, the list of commands is edited, the cell is disturbed."""

import re
import time
from dataclasses import replace

from handey_studio.app.autosave import FOLDER
from handey_studio.session import write_session
from handey_studio.session.sequence import states_of
from tests.browser.conftest import ARTEFACTS, LARGE
from tests.browser.hands import choose, pane, press, says, type_into, wait_until
from tests.session.samples import fresh_session, library, performed_session


def press_row(page, name: str) -> None:
    pane(page, name).click()
    time.sleep(0.2)


def test_what_really_happened_is_played_and_told(studio, visit, tmp_path):
    workbench = studio(performed_session(tmp_path))
    page = visit(workbench, viewport=LARGE)
    press_row(page, "happened-0")
    wait_until(lambda: "nobody knows where the part is" in pane(page, "step-name").inner_text())
    press(page, "Plots")
    plots = pane(page, "plots")
    box, first = plots.bounding_box(), plots.inner_html()
    page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    wait_until(lambda: abs(workbench.state.session.view.time_s - 3.5) < 0.1)
    wait_until(lambda: abs(line_at(page) - 50.0) < 1.0)
    assert "wrist 0.0 N" in pane(page, "measured").inner_text()
    page.screenshot(path=ARTEFACTS / "execution.png")
    press_row(page, "happened-2")
    wait_until(lambda: "attempt 2 of 2" in pane(page, "step-name").inner_text())
    assert plots.inner_html() != first, "the other attempt's curves"
    press(page, "CSV")
    says(page, "opens the hand by 100")


def line_at(page) -> float:
    """How far across the plots [%] the line of the time stands."""
    return float(re.search(r"left: ?([\d.]+)%", pane(page, "plot-cursor").get_attribute("style"))[1])


def test_what_was_left_behind_is_taken_up_edited_and_disturbed(studio, visit, tmp_path):
    left = tmp_path / FOLDER / "999999999.handey"
    left.parent.mkdir()
    write_session(left, replace(fresh_session(tmp_path), seed=4242))
    workbench = studio(fresh_session(tmp_path), library=library(tmp_path))
    page = visit(workbench)
    press(page, "Take it up")
    wait_until(lambda: workbench.state.session.seed == 4242)
    wait_until(lambda: pane(page, "left-behind").count() == 0)
    assert not left.exists() and workbench.state.unsaved
    press(page, "Add")
    wait_until(lambda: len(workbench.state.session.commands) == 2)
    choose(page, "Destination", "a pose on the table")
    type_into(page, "Position (mm)", "444")
    wait_until(lambda: workbench.state.session.commands[1].to.startswith("0.444"))
    press(page, "▲")
    wait_until(lambda: workbench.state.session.commands[0].to.startswith("0.444"))
    press_row(page, "command-1")
    press(page, "Skip")
    wait_until(lambda: states_of(workbench.state.session)[1].status == "skipped")
    wait_until(lambda: pane(page, "command-1").get_attribute("data-status") == "skipped")
    page.get_by_role("tab", name="Cell").click()
    choose(page, "Disturbance", "push")
    type_into(page, "Force (N)", "30")
    press(page, "Disturb")
    wait_until(lambda: workbench.state.session.workcell.setup.faults != ())
    wait_until(lambda: "30 N" in pane(page, "faults").inner_text())
    press(page, "Clear all disturbances")
    wait_until(lambda: workbench.state.session.workcell.setup.faults == ())
