"""Parts modelled in a real browser, by clicks: a carton that is found again in another scan, and the L block from two scans."""

import time

import numpy as np
import trimesh

from handey_studio.app.modelling import derived
from handey_studio.geometry import box
from handey_studio.geometry.transforms import apply, from_xyz_rpy, inverse, rotation_about, transform
from tests.browser.conftest import ARTEFACTS, LARGE
from tests.browser.hands import choose, pane, press, says, type_into, upload, wait_until
from tests.browser.objects import looking, write_scan
from tests.browser.test_workbench import drag, pixel_of
from tests.session.samples import fresh_session, library

WORKING_S = 90.0  # on a busy machine, with everything compiled for the first time
WIDE = {"width": 1280, "height": 720}  # two scans side by side between the panels
CARTON = (0.20, 0.13, 0.09)
IN_BOTH = (1, 6, 9)  # corners of the L block that both of its scans show


def solid_of(workbench):
    shown = derived.built(workbench.state)
    return shown.solid if shown is not None else None


def take_suggestion(page, workbench) -> None:
    wait_until(lambda: derived.suggestion(workbench.state) is not None, WORKING_S)
    assert derived.suggestion(workbench.state).solid is not None, derived.suggestion(workbench.state).reason
    page.get_by_role("button", name="Take this model", exact=True).wait_for()
    press(page, "Take this model")
    wait_until(lambda: derived.truth(workbench.state) is not None, WORKING_S)


def click_at(page, workbench, point) -> None:
    page.mouse.click(*pixel_of(page, workbench, 10.0 * np.asarray(point)))
    time.sleep(0.3)


def test_a_carton_is_modelled_edited_found_in_another_scan_and_kept(studio, visit, tmp_path):
    scans = [
        write_scan(tmp_path, f"carton{k}", box(CARTON), from_xyz_rpy((x, y, CARTON[2] / 2), (0.0, 0.0, yaw)), looking(eye, at), 0.0015, k)
        for k, x, y, yaw, eye, at in (
            (1, 0.0, 0.0, 0.4, (0.45, -0.55, 0.60), (0.0, 0.0, 0.03)),
            (2, 0.05, -0.03, 2.0, (-0.40, -0.50, 0.70), (0.0, 0.0, 0.03)),
        )
    ]
    workbench = studio(fresh_session(tmp_path))
    page = visit(workbench, viewport=LARGE)
    page.get_by_role("tab", name="Model", exact=True).click()
    upload(page, "Upload a scan", *scans[0])
    take_suggestion(page, workbench)
    solid = solid_of(workbench)
    sides = sorted(float(np.linalg.norm(solid.vertices[edge.end] - solid.vertices[edge.start])) for edge in solid.edges)
    assert np.allclose(sides[::4], sorted(CARTON), atol=0.008) and len(solid.faces) == 6
    _move_the_top(page, workbench)
    steps = [change.label for change in workbench.state.undo]
    page.reload()
    page.get_by_role("button", name="Back to MOVE").wait_for(timeout=WORKING_S * 1e3)
    assert [change.label for change in workbench.state.undo] == steps and solid_of(workbench) is not None
    _undo_and_redo_everything(page, workbench)
    page.get_by_role("tab", name="Part", exact=True).click()
    pane(page, "history").wait_for()
    choose(page, "Colour readings by", "distance")
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    time.sleep(1.0)
    page.screenshot(path=ARTEFACTS / "model_carton.png")
    upload(page, "Find it in a scan", *scans[1])
    wait_until(lambda: derived.tried(workbench.state) is not None, WORKING_S)
    poses = derived.tried(workbench.state).poses
    assert len(poses) == 1 and poses[0].score > 0.5
    press(page, "Back to the model")
    type_into(page, "Part name", "my carton")
    press(page, "Save the part")
    says(page, 'Saved "my carton"')
    assert "my carton" in library(tmp_path).drafts()


def _move_the_top(page, workbench) -> None:
    """A typed height, then a drag of the arrow: one step each."""
    solid = solid_of(workbench)
    top = int(np.argmax(solid.normals[:, 2]))
    middle = solid.vertices[list(solid.faces[top].outer)].mean(axis=0) + np.array([0.01, 0.005, 0.0])
    click_at(page, workbench, middle)
    wait_until(lambda: workbench.state.model.picked)
    pane(page, "picked").wait_for()
    type_into(page, "Exactly (mm)", "92")
    wait_until(lambda: abs(np.ptp(solid_of(workbench).vertices[:, 2]) - 0.092) < 1e-6)
    count = len(workbench.state.undo)
    for _ in range(4):  # software rendering shows the arrow some time after the click
        click_at(page, workbench, (*middle[:2], 0.092))
        time.sleep(1.5)
        start, up = 10.0 * np.array(workbench.state.model.picked[0].point), np.array([0.0, 0.0, 0.2])
        drag(page, workbench, start + 2.0 * up, start + 3.0 * up)
        if len(workbench.state.undo) > count:
            break
    wait_until(lambda: len(workbench.state.undo) == count + 1)
    assert workbench.state.undo[-1].label.startswith("move face")
    press(page, f"Undo: {workbench.state.undo[-1].label}")
    wait_until(lambda: abs(np.ptp(solid_of(workbench).vertices[:, 2]) - 0.092) < 1e-6)


def _undo_and_redo_everything(page, workbench) -> None:
    before, count = workbench.state.session.draft, len(workbench.state.undo)
    page.evaluate("document.activeElement.blur()")  # in a field Ctrl+Z is the field's own
    for left in range(count - 1, -1, -1):
        page.keyboard.press("Control+z")
        wait_until(lambda left=left: len(workbench.state.undo) == left)
    assert workbench.state.session.draft is None
    for done in range(1, count + 1):
        page.keyboard.press("Control+Shift+z")
        wait_until(lambda done=done: len(workbench.state.undo) == done)
    assert workbench.state.session.draft == before


def test_the_l_block_is_modelled_from_two_scans(studio, visit, tmp_path):
    """Aligned by planes, undone, aligned by picked points; reloaded in the middle; a size typed; all of it undone and redone."""
    block = library(tmp_path).part("l_block").solid
    placed = _two_ways(block)
    scans = [write_scan(tmp_path, f"l{k}", block, T, _from_the_front(block, T), 0.0005, 3 + k) for k, T in enumerate(placed)]
    workbench = studio(fresh_session(tmp_path))
    page = visit(workbench, viewport=WIDE)
    page.get_by_role("tab", name="Model", exact=True).click()
    upload(page, "Upload a scan", *scans[0])
    wait_until(lambda: derived.suggestion(workbench.state) is not None, WORKING_S)
    upload(page, "Upload a scan", *scans[1])
    page.get_by_role("button", name="Accept this alignment", exact=True).wait_for(timeout=WORKING_S * 1e3)
    press(page, "Accept this alignment")
    wait_until(lambda: workbench.state.session.draft.operations)
    page.keyboard.press("Control+z")
    wait_until(lambda: not workbench.state.session.draft.operations)
    _align_by_points(page, workbench, block, placed)
    page.reload()
    page.get_by_role("button", name="Back to MOVE").wait_for(timeout=WORKING_S * 1e3)
    assert len(workbench.state.session.draft.scans) == 2 and len(workbench.state.session.draft.operations) == 1
    take_suggestion(page, workbench)
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    time.sleep(1.0)
    page.screenshot(path=ARTEFACTS / "model_l_block.png")
    _is_the_block(solid_of(workbench), block)
    solid = solid_of(workbench)
    top = max(range(len(solid.faces)), key=lambda f: solid.normals[f, 2] + solid.offsets[f])
    click_at(page, workbench, solid.vertices[solid.face_triangles(top)[0]].mean(axis=0))
    pane(page, "picked").wait_for()
    type_into(page, "Exactly (mm)", "41")
    wait_until(lambda: abs(np.ptp(solid_of(workbench).vertices[:, 2]) - 0.041) < 1e-6)
    _undo_and_redo_everything(page, workbench)


def _two_ways(block) -> list:
    """T_world_block of the block lying, and on its side."""
    turns = (rotation_about((0, 0, 1), -0.9), rotation_about((0, 0, 1), 1.2) @ rotation_about((0, 1, 0), np.pi / 2))
    return [transform(turn, (0.0, 0.0, -(block.vertices @ turn[2]).min())) for turn in turns]


def _from_the_front(block, T):
    """A camera that looks at the block."""
    middle = apply(T, block.vertices).mean(axis=0)
    eye = middle + 0.35 * np.array([0.6, -0.6, 0.75]) / np.linalg.norm([0.6, -0.6, 0.75])
    return looking(tuple(eye), tuple(middle))


def _align_by_points(page, workbench, block, placed) -> None:
    """Three corners that both scans show, clicked by turns."""
    pane(page, "tool-align").click()
    wait_until(lambda: workbench.state.model.tool == "align")
    time.sleep(2.0)
    scans, poses = workbench.state.session.draft.scans, derived.scan_poses(workbench.state)
    cameras = [_from_the_front(block, T) for T in placed]
    shown = [
        pose @ scan.view.T_world_sensor @ inverse(camera) @ T for pose, scan, camera, T in zip(poses, scans, cameras, placed, strict=True)
    ]
    for clicks, (corner, T) in enumerate((corner, T) for corner in block.vertices[list(IN_BOTH)] for T in shown):
        for _ in range(6):  # software rendering on a busy machine shows the scans where the camera went some time later
            click_at(page, workbench, apply(T, corner))
            page.wait_for_timeout(500 if len(workbench.state.model.clicks) > clicks else 4000)
            if len(workbench.state.model.clicks) > clicks:
                break
        assert len(workbench.state.model.clicks) == clicks + 1
        assert workbench.state.model.clicks[-1].kind == "vertex"
    press(page, "Align by these points")
    page.get_by_role("button", name="Accept this alignment", exact=True).wait_for(timeout=WORKING_S * 1e3)
    press(page, "Accept this alignment")
    wait_until(lambda: workbench.state.session.draft.operations)


def _is_the_block(solid, block) -> None:
    """All lengths within 0.5 mm, all angles within 0.3°."""
    lengths = [sorted(np.linalg.norm(s.vertices[edge.end] - s.vertices[edge.start]) for edge in s.edges) for s in (solid, block)]
    assert len(lengths[0]) == len(lengths[1]) and np.abs(np.subtract(*lengths)).max() < 0.0005
    angles = [sorted(np.rad2deg(abs(edge.dihedral)) for edge in s.edges) for s in (solid, block)]
    assert np.abs(np.subtract(*angles)).max() < 0.3


def test_a_mesh_file_becomes_the_model_once_its_unit_is_told(studio, visit, tmp_path):
    solid = box((0.04, 0.05, 0.06))
    trimesh.Trimesh(1e3 * solid.vertices, solid.triangles).export(tmp_path / "brick.stl")
    workbench = studio(fresh_session(tmp_path))
    page = visit(workbench)
    page.get_by_role("tab", name="Model", exact=True).click()
    upload(page, "Import a mesh", tmp_path / "brick.stl")
    page.get_by_role("button", name="Import it", exact=True).wait_for(timeout=WORKING_S * 1e3)
    choose(page, "Its unit", "m: 4e+04 × 5e+04 × 6e+04 mm")
    press(page, "Import it")
    pane(page, "model-next").filter(has_text="is the unit right?").wait_for(timeout=WORKING_S * 1e3)
    assert workbench.state.session.draft is None
    choose(page, "Its unit", "mm: 40 × 50 × 60 mm")
    press(page, "Import it")
    wait_until(lambda: solid_of(workbench) is not None, WORKING_S)
    assert np.allclose(np.ptp(solid_of(workbench).vertices, axis=0), (0.04, 0.05, 0.06), atol=1e-6)
    page.get_by_role("tab", name="Part", exact=True).click()
    pane(page, "part-grasps").wait_for(timeout=WORKING_S * 1e3)
    press(page, "Undo: import brick.stl")
    wait_until(lambda: workbench.state.session.draft is None)


def test_the_example_is_scanned_turned_over_modelled_and_found(studio, visit, tmp_path):
    workbench = studio(fresh_session(tmp_path))
    page = visit(workbench, viewport=LARGE)
    page.get_by_role("tab", name="Model", exact=True).click()
    press(page, "Start from an example")
    take_suggestion(page, workbench)
    assert workbench.state.session.name == "model_a_part"
    page.get_by_role("tab", name="Part", exact=True).click()
    press(page, "Find it")
    wait_until(lambda: workbench.state.session.scene is not None, WORKING_S)
    wait_until(lambda: not workbench.state.model.open)
    assert [placed.part.name for placed in workbench.state.session.located] == ["part"]
    assert workbench.state.command.part == "part"
    page.get_by_role("button", name="MOVE", exact=True).wait_for()
