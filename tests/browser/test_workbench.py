"""The workbench clicked through in a real browser."""

import re
import time
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from handey_studio.session import own_file, read_session, session_to_bytes
from tests.browser.conftest import ARTEFACTS, LARGE
from tests.browser.hands import choose, fields, pane, press, says, type_into, wait_until
from tests.browser.planners import dying, patient, refusing
from tests.session.samples import fresh_session, full_session, library

EMPTY = {"Located": "sensing"}


def destination(workbench) -> list[float]:
    return [float(word) for word in workbench.state.command.to.split(",")]


def test_the_page_shows_the_cell_and_says_what_to_do(studio, visit, tmp_path):
    begun = time.monotonic()
    workbench = studio(full_session(tmp_path))
    page = visit(workbench, viewport=LARGE)
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    (ARTEFACTS / "page_usable_s.txt").write_text(f"{time.monotonic() - begun:.2f}\n")
    wait_until(lambda: "Planned" in pane(page, "next-step").inner_text())
    assert "transfer" in pane(page, "timeline").inner_text()
    time.sleep(3.0)
    shot = page.screenshot(path=ARTEFACTS / "workbench.png")
    assert len(shot) > 100_000, "an empty canvas compresses to far less"


def test_an_empty_workbench_tells_how_to_fill_it(studio, visit, tmp_path):
    workbench = studio(fresh_session(tmp_path))
    page = visit(workbench)
    assert "Ready to MOVE" in pane(page, "next-step").inner_text()
    assert "Press Plan or MOVE" in pane(page, "timeline-empty").inner_text()
    for tab in ("Located", "Grasp", "Path", "Ledger", "Result"):
        page.get_by_role("tab", name=tab).click()
        pane(page, f"{EMPTY.get(tab, tab.lower())}-empty").wait_for()
    press(page, "Guide")
    page.get_by_role("dialog").get_by_text("The configuration space").first.wait_for()
    page.keyboard.press("Escape")
    page.get_by_role("dialog").wait_for(state="detached")
    press(page, "Keys")
    pane(page, "keys").get_by_text("play or pause").wait_for()
    page.keyboard.press("m")  # no shortcut while a dialog is open
    page.keyboard.press("Enter")
    page.get_by_role("dialog").wait_for(state="detached")
    assert workbench.state.jobs == 0
    page.get_by_role("tab", name="View").click()
    page.get_by_label("Dark page").click()
    page.locator(":root[data-mantine-color-scheme=dark]").wait_for(state="attached")


def test_what_the_user_set_is_undone_and_redone(studio, visit, tmp_path):
    workbench = studio(fresh_session(tmp_path))
    page = visit(workbench)
    type_into(page, "Position (mm)", "410")
    wait_until(lambda: destination(workbench)[0] == 0.41)
    type_into(page, "Turn (deg)", "30", 2)
    wait_until(lambda: destination(workbench)[5] == 30)
    press(page, "Undo: type destination")
    wait_until(lambda: destination(workbench)[5] == 90 and destination(workbench)[0] == 0.41)
    page.keyboard.press("Control+z")
    wait_until(lambda: destination(workbench)[0] == 0.35)
    wait_until(lambda: page.get_by_role("button", name=re.compile("^Undo")).count() == 0)
    press(page, "Redo: type destination")
    wait_until(lambda: destination(workbench)[0] == 0.41)
    wait_until(lambda: fields(page, "Position (mm)").first.input_value() == "410")


def test_choosing_another_part_is_one_step(studio, visit, tmp_path):
    workbench = studio(fresh_session(tmp_path))
    page = visit(workbench)
    choose(page, "Part", "brick")
    wait_until(lambda: workbench.state.command.part == "brick")
    choose(page, "Part", "l_block")
    choose(page, "Destination", "on:l_block:block")
    wait_until(lambda: workbench.state.command.to == "on:l_block:block")
    press(page, "Undo: set destination")
    wait_until(lambda: workbench.state.command.to.startswith("0.35"))


def test_a_session_is_saved_and_comes_back_after_reload(studio, visit, tmp_path):
    workbench = studio(full_session(tmp_path))
    page = visit(workbench)
    type_into(page, "Position (mm)", "333")
    press(page, "Save as")
    type_into(page, "Name", "my pile")
    press(page, "Save under this name")
    says(page, 'Saved "my pile"')
    saved = read_session(own_file(library(tmp_path), "my pile"))
    assert saved.commands[-1].to.startswith("0.333,") and saved.scene == workbench.state.session.scene
    assert not workbench.state.unsaved
    page.reload()
    pane(page, "session-about").get_by_text("my pile").wait_for()
    wait_until(lambda: fields(page, "Position (mm)").first.input_value() == "333")


def test_a_session_is_opened_from_the_library_and_the_unsaved_one_is_kept(studio, visit, tmp_path):
    own = library(tmp_path)
    other = replace(full_session(tmp_path), name="other")
    own_file(own, "other").parent.mkdir(parents=True)
    own_file(own, "other").write_bytes(session_to_bytes(other))
    workbench = studio(fresh_session(tmp_path), library=own)
    page = visit(workbench)
    type_into(page, "Position (mm)", "444")
    press(page, "Open")
    choose(page, "Name", "other")
    press(page, "Open this session")
    wait_until(lambda: workbench.state.session.name == "other")
    assert workbench.state.session == replace(other, view=workbench.state.session.view)
    assert read_session(own_file(own, "sample (unsaved)")).commands[-1].to.startswith("0.444,")
    press(page, "New")
    wait_until(lambda: workbench.state.session.scene is None and workbench.state.session.name == "untitled")


def test_download_and_upload_round_trip(studio, visit, tmp_path):
    workbench = studio(full_session(tmp_path))
    page = visit(workbench)
    with page.expect_download() as caught:
        press(page, "Download")
    caught.value.save_as(tmp_path / "back.handey")
    before = workbench.state.session
    with page.expect_download() as caught:
        press(page, "Replay as a page")
    caught.value.save_as(tmp_path / "replay.html")
    assert "__VISER_EMBED_DATA__=" in (tmp_path / "replay.html").read_text() and workbench.state.session == before
    press(page, "New")
    wait_until(lambda: workbench.state.session.scene is None)
    press(page, "Open")
    page.get_by_role("dialog").locator('input[type="file"]').set_input_files(tmp_path / "back.handey")
    wait_until(lambda: workbench.state.session.scene is not None)
    assert workbench.state.session.scene == before.scene and workbench.state.session.results == before.results


def test_a_broken_upload_is_told_and_changes_nothing(studio, visit, tmp_path):
    workbench = studio(fresh_session(tmp_path))
    page = visit(workbench)
    (tmp_path / "broken.handey").write_bytes(b"\x1f\x8b not a session")
    press(page, "Open")
    page.get_by_role("dialog").locator('input[type="file"]').set_input_files(tmp_path / "broken.handey")
    says(page, "broken.handey")
    assert workbench.state.session.name == "sample"
    type_into(page, "Position (mm)", "300")
    wait_until(lambda: destination(workbench)[0] == 0.3)


def test_two_browsers_share_one_session(studio, visit, tmp_path):
    workbench = studio(fresh_session(tmp_path))
    first, second = visit(workbench), visit(workbench)
    type_into(first, "Position (mm)", "380")
    wait_until(lambda: fields(second, "Position (mm)").first.input_value() == "380")
    pane(second, "session-about").get_by_text("Viewers").wait_for()
    first.context.close()
    wait_until(lambda: workbench.state.viewers == 1)
    press(second, "Undo: type destination")
    wait_until(lambda: destination(workbench)[0] == 0.35)


def test_the_page_stays_live_while_planning_and_cancel_ends_it(studio, visit, tmp_path):
    workbench = studio(fresh_session(tmp_path), run=patient)
    page = visit(workbench)
    press(page, "Plan")
    wait_until(lambda: "Grasp group" in pane(page, "next-step").inner_text())
    page.get_by_role("tab", name="View").click()
    page.get_by_role("checkbox", name="Robot").uncheck()
    wait_until(lambda: "robot" in workbench.state.session.view.hidden_layers)
    page.get_by_role("tab", name="Move").click()
    press(page, "Cancel")
    wait_until(lambda: workbench.state.job is None)
    says(page, "cancelled")


def test_a_browser_that_leaves_while_planning_finds_it_again(studio, visit, tmp_path):
    workbench = studio(fresh_session(tmp_path), run=patient)
    page = visit(workbench)
    press(page, "Plan")
    wait_until(lambda: workbench.state.job is not None and workbench.state.job.fraction > 0)
    page.context.close()
    wait_until(lambda: workbench.state.viewers == 0)
    page = visit(workbench, ready="Cancel")
    wait_until(lambda: "Grasp group" in pane(page, "next-step").inner_text())
    press(page, "Cancel")
    wait_until(lambda: workbench.state.job is None)


def test_a_planner_that_breaks_down_is_told_and_replaced(studio, visit, tmp_path):
    workbench = studio(fresh_session(tmp_path), run=dying)
    page = visit(workbench)
    press(page, "Plan")
    says(page, "The planner broke down (exit status 7)")
    press(page, "MOVE")
    says(page, "survived")


def test_bad_input_is_a_sentence_and_its_words_are_no_markup(studio, visit, tmp_path):
    workbench = studio(fresh_session(tmp_path), run=refusing)
    page = visit(workbench)
    press(page, "Plan")
    says(page, 'the part "<b>l_block</b>" is not to my taste.')


def test_names_from_a_file_cannot_run_as_script(studio, visit, tmp_path):
    full = full_session(tmp_path)
    evil = "<img src=x onerror='window.hacked=1'>"
    instances = tuple(replace(placed, name=evil) for placed in full.scene.instances)
    entries = tuple(replace(entry, option=evil, reason=evil, bodies=(evil,)) for entry in full.results[0].ledger)
    result = replace(full.results[0], ledger=entries, reason=evil, status="failed")
    session = replace(full, scene=replace(full.scene, instances=instances), results=(result,))
    page = visit(studio(session))
    for tab in ("Located", "Grasp", "Path", "Ledger", "Result"):
        page.get_by_role("tab", name=tab).click()
        time.sleep(0.3)
    assert page.evaluate("window.hacked") is None
    assert page.locator('img[src="x"]').count() == 0


def test_the_timeline_moves_the_arm(studio, visit, tmp_path):
    workbench = studio(full_session(tmp_path))
    page = visit(workbench)
    still = link_positions(workbench)
    press(page, "Step ▶")
    wait_until(lambda: workbench.state.session.view.time_s == 2.0)
    wait_until(lambda: np.abs(link_positions(workbench) - still).max() > 0.5)
    page.keyboard.press("Space")
    wait_until(lambda: workbench.state.playing)
    wait_until(lambda: workbench.state.session.view.time_s > 2.5)
    page.keyboard.press("Space")
    wait_until(lambda: not workbench.state.playing)
    press(page, "|◀")
    wait_until(lambda: np.abs(link_positions(workbench) - still).max() < 1e-6)


def link_positions(workbench) -> np.ndarray:
    """Where the browser's robot has its links."""
    handles = workbench.server.scene._handle_from_node_name
    return np.array([handles[f"/robot/link{i}"].position for i in range(7)])


def test_the_ghost_is_dragged_snaps_and_is_one_undo_step(studio, visit, tmp_path):
    workbench = studio(fresh_session(tmp_path))
    page = visit(workbench, viewport=LARGE)
    before = destination(workbench)
    along = np.array([0.0, 1.0, 0.0])  # the part is turned by 90°, so its x arrow points along the world's y
    tip = 10.0 * np.array(before[:3]) + along
    for _ in range(6):  # software rendering shows the gizmo some seconds after the buttons; a drag before that turns the camera
        time.sleep(2.0)
        drag(page, workbench, tip, tip + 0.6 * along)
        if workbench.state.undo:
            break
    wait_until(lambda: workbench.state.undo)
    after = destination(workbench)
    assert abs(after[1] - before[1]) > 0.01
    assert all(abs(1e3 * number - round(1e3 * number)) < 1e-6 for number in after[:2])
    press(page, "Undo: drag destination")
    wait_until(lambda: destination(workbench) == before)


def drag(page, workbench, start: np.ndarray, end: np.ndarray) -> None:
    """Press at one point of the scene, move to another, let go."""
    page.mouse.move(*pixel_of(page, workbench, start))
    time.sleep(0.5)
    page.mouse.down()
    page.mouse.move(*pixel_of(page, workbench, end), steps=15)
    time.sleep(0.3)
    page.mouse.up()
    time.sleep(1.0)


def pixel_of(page, workbench, point: np.ndarray) -> tuple[float, float]:
    """Where a point of the scene is on the page, by the browser's own camera."""
    camera = next(iter(workbench.server.get_clients().values())).camera
    rotation = Rotation.from_quat(camera.wxyz, scalar_first=True)
    x, y, z = rotation.inv().apply(point - camera.position)
    box = page.locator("canvas").first.bounding_box()
    focal = box["height"] / 2 / np.tan(camera.fov / 2)
    return box["x"] + box["width"] / 2 + focal * x / z, box["y"] + box["height"] / 2 + focal * y / z
