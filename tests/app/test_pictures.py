"""Pictures and lists as text: what they show, and that nothing a user wrote becomes markup."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handey_studio.app import html
from handey_studio.app.cspace import nearest, slice_svg
from handey_studio.app.palette import elevation_colours
from handey_studio.app.panels.findings import result_html, timing_html
from handey_studio.app.panels.grasp import grasp_facts
from handey_studio.app.panels.ledger import context, entry_html, ledger_html
from handey_studio.app.panels.sensing import counted, found_html, picked, word_of
from handey_studio.app.panels.timeline import strip
from handey_studio.app.pictures.plane import grasp_plane_svg
from handey_studio.app.scene.cspace import FACING, slice_picture
from handey_studio.app.scene.depth import elevation_span, stride_of, thinned
from handey_studio.app.state import State, opened, with_view
from handey_studio.base import Ledger
from handey_studio.motion import CSpaceSummary
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.session.looking import unexplained
from handey_studio.world import Library
from tests.session.samples import T_START, full_session, hand_made_scan, library


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    return full_session(tmp_path_factory.mktemp("library"))


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return library(tmp_path_factory.mktemp("library")).robot("ur5")


def test_the_grasp_plane_shows_world_up_up_and_the_hand_where_it_ends(session, robot):
    run = session.results[0].plan.carries[0].approach
    svg = grasp_plane_svg(run, robot.hand)
    points = [tuple(map(float, p.split(","))) for p in re.search(r'<polyline points="([^"]+)"', svg)[1].split()]
    assert len(points) == len(run.path) and points[0][1] < points[-1][1], "the hand comes down"
    goal = re.search(r'<circle cx="([\d.-]+)" cy="([\d.-]+)"', svg)
    assert np.hypot(float(goal[1]) - points[-1][0], float(goal[2]) - points[-1][1]) < 1.0


def test_filled_cells_are_drawn_where_they_are(session, robot):
    run = session.results[0].plan.carries[0].approach
    svg = grasp_plane_svg(run, robot.hand)
    a, b, c, d, e, f = map(float, re.search(r"matrix\(([^)]+)\)", svg)[1].split())
    goal = re.search(r'<circle cx="([\d.-]+)" cy="([\d.-]+)"', svg)
    i, k = (run.goal - run.plane.origin) / run.plane.cell
    np.testing.assert_allclose((a * k + c * i + e, b * k + d * i + f), (float(goal[1]), float(goal[2])), atol=0.1)


def test_the_slice_of_the_configuration_space_is_the_one_that_the_arm_is_in():
    centres = tuple(np.deg2rad(np.arange(-175.0, 180.0, 10.0)) for _ in range(3))
    blocked = np.zeros((36, 36, 36), dtype=bool)
    space = CSpaceSummary(np.deg2rad(10), centres, blocked, np.array([[3, 4, 5], [3, 5, 5]]), None, None, np.zeros((8, 3)), 3, 1)
    assert nearest(centres[0], np.deg2rad(-147.0)) == 3
    assert nearest(centres[0], np.deg2rad(-147.0 + 360.0)) == 3
    svg = slice_svg(space, np.deg2rad([-145.0, -135.0, -125.0]), 3)
    assert svg.count("<rect") == 2 and 'cx="4.50" cy="30.50"' in svg and 'points="4.5,30.5 5.5,30.5"' in svg
    assert slice_svg(space, np.zeros(3), 4).count("<rect") == 0


def test_words_of_others_are_escaped_everywhere(session):
    evil = "<script>alert(1)</script>"
    entries = tuple(replace(entry, stage=evil, option=evil, reason=evil, bodies=(evil,)) for entry in session.results[0].ledger)
    result = replace(session.results[0], reason=evil, status="failed", plan=None, timing_s={evil: 1.0})
    scene = replace(session.scene, instances=tuple(replace(placed, name=evil) for placed in session.located))
    located = replace(scene.located, reason=evil)
    state = told(session, entries)
    shown = [
        ledger_html(state, ["b"], ["r"]),
        entry_html(entries[0], entries),
        result_html(result) + timing_html(result),
        found_html(replace(session, scene=replace(scene, located=located))),
    ]
    shown += [html.card(evil, evil, testid=evil), html.facts([(evil, evil)]), html.empty(evil), html.swatch((0, 0, 0), evil)]
    assert all("<script" not in text for text in shown)


def test_the_timeline_strip_names_the_step_at_its_time(session, tmp_path):
    state = with_view(opened(library(tmp_path), session, None), time_s=5.0)
    assert "step 3 of 5: transfer, holding l_block#1" in strip(state)
    assert "left:50.000%" in strip(state)


def told(session, entries):
    """A state that looks at a result with this ledger."""
    result = replace(session.results[0], ledger=entries)
    session = replace(session, results=(result,), view=replace(session.view, result=-1))
    here = Library.choose()
    return State(here, session, here.robot("ur5"))


def test_the_ledger_is_a_tree_of_rows_and_says_what_an_entry_belongs_to(session):
    book = Ledger()
    goal = book.add("destination", "here")
    first, second = book.add("grasp group", "edge 1", "too narrow", parent=goal), book.add("grasp group", "edge 2", parent=goal)
    hand = book.add("approach", "hand at 5°", parent=second)
    book.add("reach", "branch 3", "the arm collides", parent=hand, value=-0.013, limit=0.001, unit="m", bodies=("a", "b"))
    known = {entry.id: entry for entry in book.entries}
    assert context(book.entries[4], known) == "here › edge 2 › hand at 5°"
    assert context(book.entries[first], known) == "here" and context(book.entries[goal], known) == ""
    state = told(session, book.entries)
    text = ledger_html(state, ["b"] * 9, ["r"] * 6)
    assert "here" in text and "4 ▸" in text and "2 of 4 below it fell" in text and 'data-testid="entry-1"' not in text
    text = ledger_html(replace(state, ledger_at=hand, ledger_entry=4), ["b"] * 9, ["r"] * 6)
    assert "here › edge 2 › hand at 5°" in text and "the arm collides (a and b): -13 mm, limit 1 mm" in text
    assert "-13 mm" in entry_html(book.entries[4], book.entries)


def test_labels_lead_back_to_their_words():
    labels = counted({"it fell (badly)": 3, "all": 1})
    assert labels == ("all (4)", "it fell (badly) (3)", "all (1)")
    assert word_of(labels[1]) == "it fell (badly)" and word_of(labels[0]) == ""
    assert picked(labels, "it fell (badly)") == labels[1]
    assert picked(labels, "") == picked(labels, "gone") == labels[0]


def test_grasp_facts_speak_of_classes_and_angles(session):
    facts = dict(grasp_facts(session.results[0].plan.carries[0].grasp))
    assert facts["Legal angles"] == "69° to 109°" and facts["Fingers"] == "40.0 mm held, 60 mm open"


def test_elevation_colours_grow_lighter_above_the_table():
    colours = elevation_colours(np.linspace(0.12, 1.0, 50)).astype(float)
    lightness = colours @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(lightness) > -0.5).all() and lightness[-1] > lightness[0] + 60


def test_a_large_scan_is_thinned_and_stays_in_place():
    elevation = np.full((700, 900), 0.01)
    elevation[100:200, 100:200] = np.nan
    scan = DepthMap(elevation, 0.001, T_START, elevation)
    stride = stride_of(scan)
    points, heights = thinned(scan, np.ones(elevation.shape, dtype=bool), stride)
    assert 30_000 < len(points) <= 50_000 and (heights == 0.01).all()
    everything = scan.points_world()
    step = np.linalg.norm(everything[:, None] - points[:20][None], axis=2).min(axis=0)
    assert step.max() < 1e-12


def test_an_empty_table_is_not_blown_up():
    scan = hand_made_scan()
    assert elevation_span(replace(scan, elevation=np.full((5, 5), 0.0003), passed=np.zeros((5, 5)))) == 0.02
    assert elevation_span(replace(scan, elevation=np.full((5, 5), np.nan), passed=np.zeros((5, 5)))) == 0.02


def test_readings_on_a_located_part_leave_the_map_with_it(session):
    scan, part = session.scan, session.located[0]
    top = part.part.solid.vertices[:, 2].max()
    elevation = np.array(scan.elevation)
    j, i = np.mgrid[: elevation.shape[0], : elevation.shape[1]]
    world = np.c_[(i.ravel() + 0.5) * scan.cell, (j.ravel() + 0.5) * scan.cell] + scan.T_world_range[:2, 3]
    local = (world - T_START[:2, 3]) @ T_START[:2, :2]
    inside = ((local > 0.004) & (local < (0.055, 0.025))).all(axis=1).reshape(elevation.shape)
    elevation[inside] = top
    scene = replace(session.scene, depth_map=replace(scan, elevation=elevation), instances=(part,))
    left = unexplained(scene)
    assert not left[inside].any() and inside.sum() > 20
    far = np.hypot(*(world - T_START[:2, 3]).T).reshape(elevation.shape) > 0.12
    assert left[far & np.isfinite(elevation)].all()


def test_the_slice_in_the_scene_is_tinted_where_it_is_forbidden_and_stands_along_its_joints():
    blocked = np.zeros((5, 3), dtype=bool)
    blocked[4, 0] = True  # the second joint at its highest, the third at its lowest
    picture = slice_picture(blocked)
    assert picture.shape == (3, 5, 4) and np.argwhere(picture[:, :, 3]).tolist() == [[2, 4]]
    right, down = Rotation.from_quat(FACING, scalar_first=True).apply(np.eye(3)[:2])
    np.testing.assert_allclose((right, down), ((0, 1, 0), (0, 0, -1)), atol=1e-12)
