"""The Grasp tab in a real browser: a click on a class and on a cell of the grasp–placement table shows part and hand as ghosts."""

from tests.browser.conftest import ARTEFACTS
from tests.browser.hands import choose, pane, press, wait_until
from tests.session.samples import full_session


def test_classes_and_cells_are_looked_at_by_a_click(studio, visit, tmp_path):
    workbench = studio(full_session(tmp_path))
    page = visit(workbench)
    page.get_by_role("tab", name="Grasp").click()
    pane(page, "classes").wait_for(timeout=120_000)
    number = workbench.state.handling.ranked()[0]
    pane(page, f"class-{number}").click()
    wait_until(lambda: workbench.state.grasp_look.grasp_class == number)
    pane(page, "class-groups").wait_for()
    choose(page, "Obstacles", "both")
    wait_until(lambda: pane(page, "grasp-plane").locator("image").count() == 2)
    pane(page, "table-row-1").click()
    wait_until(lambda: workbench.state.grasp_look.row == 0 and workbench.state.grasp_look.column is None)
    pane(page, "table-cells").click()
    wait_until(lambda: workbench.state.grasp_look.column is not None)
    wait_until(lambda: "/standing/hand" in workbench.server.scene._handle_from_node_name)
    assert "Cell picked" not in page.inner_text("body")
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=ARTEFACTS / "grasp.png")
    press(page, "Clear")
    wait_until(lambda: "/standing" not in workbench.server.scene._handle_from_node_name and not workbench.state.undo)
