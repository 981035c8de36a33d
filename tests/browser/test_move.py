"""The whole MOVE of Figure 1 in a real browser: from the empty cell to the saved session."""

import time

import numpy as np

from handey_studio.geometry.transforms import pose_difference
from handey_studio.session import own_file, read_session
from tests.browser.conftest import ARTEFACTS, LARGE
from tests.browser.hands import pane, press, says, wait_until
from tests.session.samples import library

PLANNING_S = 240.0  # on a busy machine, with everything compiled for the first time


def test_figure_1_is_planned_looked_at_moved_and_saved(studio, visit, tmp_path):
    workbench = studio("figure1")
    page = visit(workbench, viewport=LARGE)
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    begun = time.monotonic()
    press(page, "Plan")
    wait_until(lambda: workbench.state.session.scene is not None, PLANNING_S)
    (ARTEFACTS / "plan_to_first_stage_s.txt").write_text(f"{time.monotonic() - begun:.2f}\n")
    wait_until(lambda: workbench.state.job is None, PLANNING_S)
    assert workbench.state.session.results[0].status == "planned", workbench.state.session.results[0].reason
    wait_until(lambda: "Planned" in pane(page, "next-step").inner_text())
    assert workbench.state.session.cell_now is None, "planning moves nothing"
    _look_at_every_pane(page)
    press(page, "MOVE")
    wait_until(lambda: workbench.state.job is None, PLANNING_S)
    result = workbench.state.session.results[0]
    assert result.status == "done", result.reason
    metres, radians = pose_difference(result.T_world_part_reached, result.T_world_part_goal)
    assert metres < 0.004 and np.rad2deg(radians) < 1.0
    says(page, "is done")
    page.keyboard.press("Home")
    for _ in workbench.state.replay.starts:
        time.sleep(0.2)
        page.keyboard.press("L")
    wait_until(lambda: workbench.state.session.view.time_s == workbench.state.replay.duration)
    time.sleep(2.0)
    page.screenshot(path=ARTEFACTS / "move_done.png")
    page.keyboard.press("Control+s")
    says(page, 'Saved "figure1"')
    saved = read_session(own_file(library(tmp_path), "figure1"))
    assert saved.results == workbench.state.session.results and saved.cell_now == workbench.state.session.cell_now


def _look_at_every_pane(page) -> None:
    page.get_by_role("tab", name="Located").click()
    pane(page, "located").first.wait_for()
    page.get_by_role("tab", name="Grasp").click()
    pane(page, "grasp-plane").wait_for()
    time.sleep(1.0)
    page.screenshot(path=ARTEFACTS / "move_planned.png")
    page.get_by_role("tab", name="Ledger").click()
    pane(page, "ledger").wait_for()
    page.get_by_role("tab", name="Result").click()
    pane(page, "result").wait_for()
