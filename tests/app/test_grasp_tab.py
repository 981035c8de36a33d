"""The Grasp tab: pictures that show what is there, clicks that mean what was clicked, ghosts that stand on the table."""

import re
import threading
from dataclasses import replace

import numpy as np
import pytest

from handey_studio.app.background import Background
from handey_studio.app.grasp_commands import LookAtStanding, LookAway, PickCell, PickClass, ShowObstacles, looked_at, standing_pose
from handey_studio.app.handling import Handle
from handey_studio.app.pictures.classes import classes_html
from handey_studio.app.pictures.dial import HEIGHT, KINDS, VIEW_M, WIDTH, dial_svg, dial_words, kind_of
from handey_studio.app.pictures.plane import BOTH, PICKUP, PUTDOWN, grasp_plane_svg, iteration_at, plane_words
from handey_studio.app.pictures.svg import PlaneView
from handey_studio.app.pictures.table import cell_words, layout_of, table_html
from handey_studio.app.setting_up import ChoosePart
from handey_studio.app.state import Handled, opened
from handey_studio.base import Ledger
from handey_studio.geometry.transforms import apply
from handey_studio.grasping import GOAL, START, ForbiddenRange, GraspPlane, hand_outline, plan_approach
from handey_studio.session.handling import handling
from tests.session.samples import fresh_session, full_session, library

EVIL = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    folder = tmp_path_factory.mktemp("library")
    state = opened(library(folder), full_session(folder), None)
    return Handle(Handled(state.to_handle, handling(*state.to_handle))).apply(state)


@pytest.fixture(scope="module")
def grasp(state):
    return state.carry.grasp


def _drawn_angles(svg: str, title: str, view: PlaneView, grasp) -> list[float]:
    """Hand angles [rad] at the ends of the arc with a title, read back from the picture."""
    points = re.search(rf'<polyline points="([^"]+)"[^>]*><title>{re.escape(title)}', svg)[1].split()
    middle = np.array([float(x) for x in re.search(r'<circle cx="([\d.-]+)" cy="([\d.-]+)"', svg).groups()])
    found = []
    for point in (points[0], points[-1]):
        x, y = np.array([float(n) for n in point.split(",")]) - middle
        back = np.linalg.solve(view.directions(np.eye(2)).T, -np.array([x, y]))
        found.append(float(np.arctan2(back[1], back[0])))
    return found


def test_the_dial_shows_each_forbidden_range_where_it_is_on_the_hands_side(state, grasp):
    ranges = (ForbiddenRange(0.9, 1.2, "pickup", "depth map"), ForbiddenRange(1.9, 2.3, "putdown", EVIL))
    told = replace(grasp, forbidden=ranges)
    T = state.carry.T_world_part_start @ grasp.T_part_plane
    svg = dial_svg(told, T, np.array([0.01, 0.02]), state.robot.hand, state.session.part("l_block"))
    view = PlaneView(T, (0.01, 0.02), VIEW_M, WIDTH)
    np.testing.assert_allclose(_drawn_angles(svg, "depth map", view, told), (0.9, 1.2), atol=0.01)
    np.testing.assert_allclose(_drawn_angles(svg, "legal", view, told), (1.2, 1.9), atol=0.01)
    assert "<script" not in svg and "40° of 80° are legal" in dial_words(told)
    assert "nothing is in the hand's way" in dial_words(grasp)
    inside = [tuple(map(float, p.split(","))) for p in re.findall(r"[\d.]+,[\d.]+", svg)]
    assert all(-60 < x < WIDTH + 60 and -60 < y < HEIGHT + 90 for x, y in inside)


def test_every_kind_of_forbidden_range_has_a_name_of_its_own():
    both = ForbiddenRange(0.0, 1.0, "both", "l_block#1")
    ranges = (replace(both, end="pickup"), replace(both, end="putdown"), both, replace(both, body="", what="contact"))
    assert [kind_of(f) for f in (*ranges, replace(both, body="", what="reach"))] == [kind for kind, _ in KINDS]


def test_the_plane_shows_the_bump_lines_that_touch_at_the_iteration_of_the_hand(state):
    hand, heap = state.robot.hand, np.zeros((400, 400), dtype=bool)
    heap[160:192, :140] = heap[208:, :140] = True  # a gap between two heaps, hardly wider than the hand
    plane = GraspPlane(state.carry.approach.plane.T_world_plane, np.array([-0.4, -0.25]), 0.002, heap, heap)
    run = plan_approach(plane, hand_outline(hand), np.array([0.004, 0.08, -np.pi / 2]), np.array([0.0, 0.0]))
    told = run.iterations
    k = int(np.argmax(told.colliding.sum(axis=1)))
    assert told.colliding[k].any(), "the heaps are near enough"
    assert iteration_at(run, hand_outline(hand), told.poses[k])[1] == k
    run = replace(run, path=np.vstack([told.poses[: k + 1], run.path[-1:]]))
    svg = grasp_plane_svg(run, hand, k)
    assert len(re.findall(r'stroke="#cc4c18" stroke-width="2.4"', svg)) == told.colliding[k].sum()
    said = plane_words(run, hand_outline(hand), k)
    assert f"Iteration {k + 1} of {len(told.poses)}" in said and f"{told.colliding[k].sum()} bump line" in said
    other = replace(hand, T_flange_hand=np.eye(4))  # without a mount, so with fewer bump lines
    assert iteration_at(run, hand_outline(other), told.poses[k]) is None and "Iteration" not in plane_words(run, hand_outline(other), k)
    assert grasp_plane_svg(run, other, k).count("unit circle") == 0


def test_the_putdowns_cells_come_on_top_of_the_pickups_or_in_their_place(state):
    carry, hand, part = state.carry, state.robot.hand, state.session.part("l_block")
    counts = [
        grasp_plane_svg(carry.approach, hand, 0, carry.grasp, part, putdown, which).count("<image")
        for putdown, which in (
            (None, BOTH),
            (state.handling.putdowns[0], PICKUP),
            (state.handling.putdowns[0], PUTDOWN),
            (state.handling.putdowns[0], BOTH),
        )
    ]
    assert counts == [1, 1, 1, 2]
    assert ShowObstacles(BOTH).apply(state).grasp_look.obstacles == BOTH


def test_classes_are_shown_ranked_with_what_became_of_their_groups(state):
    told, book = state.handling, Ledger()
    names = [told.groups[g].name for g in told.groups_of(told.ranked()[0])]
    book.add("grasp group", names[1], EVIL)
    book.add("grasp group", names[2])
    page = classes_html(told, {e.option: e for e in book.entries}, names[0], told.ranked()[0], "id")
    assert "1 chosen, 1 stood, 1 fell" in page and "<script" not in page
    order = [int(n) for n in re.findall(r'data-testid="class-(\d+)"', page)]
    assert order == told.ranked() and page.count("✕") == 1 + sum(e.reason is not None for e in told.fell)


def test_a_click_into_the_table_means_the_cell_that_is_there(state):
    told = state.handling
    for grasp_class in (None, told.ranked()[0]):
        layout = layout_of(told, grasp_class)
        assert layout.rows == told.rows and sum(count for _, count in layout.classes) == len(layout.columns)
        for place in range(len(layout.rows)):
            assert layout.picked(told, layout.code(place)) == (layout.rows[place], None)
            for across in (0, len(layout.columns) - 1):
                row, column = layout.picked(told, layout.code(place) + across + 1)
                assert row == layout.rows[place] and column in layout.columns[across]
                assert told.legal(row)[column] == told.legal(row)[list(layout.columns[across])].any()
        assert layout.picked(told, layout.code(len(layout.rows))) is None is layout.picked(told, -1)


def test_the_table_says_what_speaks_against_a_cell(state):
    told = state.handling
    row, column = (int(x[0]) for x in np.nonzero(~told.table.legal & told.table.sound))
    assert "the hand would reach into the table" in cell_words(told, row, column)
    assert cell_words(told, *(int(x[0]) for x in np.nonzero(told.table.legal))).endswith(": legal.")
    assert "Click a row" in cell_words(told, None, None) and "grasps are legal" in cell_words(told, START, None)
    page = table_html(told, layout_of(told, None), row, column, ((START, column), (GOAL, column)), "id")
    assert page.count("<circle") == 3 and "the sequence that was used" in page


def test_looking_at_a_class_and_a_cell_ends_with_a_second_click_or_another_part(state):
    number = state.handling.ranked()[1]
    looking = PickClass(number).apply(state)
    assert looked_at(looking).grasp_class == number and looked_at(PickClass(number).apply(looking)).grasp_class is None
    code = layout_of(state.handling, number).code(2) + 1
    at_cell = PickCell(code).apply(looking)
    assert looked_at(at_cell).row == state.handling.rows[2] and looked_at(at_cell).column is not None
    assert looked_at(PickCell(code).apply(at_cell)).row is None
    assert PickCell(10**6).apply(at_cell) is at_cell and PickClass(99).apply(at_cell) is at_cell
    assert looked_at(replace(at_cell, handled=None)).row is None, "nothing is known of the part"
    assert looked_at(LookAway().apply(at_cell)).row is None and not at_cell.undo


def test_before_any_plan_the_part_that_is_chosen_is_what_the_tab_is_about(tmp_path):
    fresh = opened(library(tmp_path), fresh_session(tmp_path), None)
    asked = fresh.to_handle
    assert asked[0] is fresh.session.part("l_block") and asked[4:] == (None, None) and fresh.handling is None
    known = Handle(Handled(asked, handling(*asked))).apply(fresh)
    assert known.handling is not None and "approach groups" in classes_html(known.handling, {}, "", None, "id")
    other = ChoosePart("brick").apply(known)
    assert other.to_handle[0].name == "brick" and other.handling is None, "it is another part's"


def test_the_ghost_stands_on_the_table_or_at_the_ends_of_the_move(state):
    part, table_z = state.handling.part, state.session.workcell.table_z
    for place, row in enumerate(state.handling.rows):
        looking = PickCell(layout_of(state.handling, None).code(place)).apply(state)
        pose = standing_pose(looking)
        if row == START:
            np.testing.assert_array_equal(pose, state.replay.plan.T_world_part_start)
        elif row != GOAL:
            assert abs(part.lowest(pose) - table_z) < 1e-6
        eye = _Eye(looking)
        LookAtStanding(None).run(eye)
        assert np.linalg.norm(eye.looked[0][1] - apply(pose, part.solid.vertices.mean(axis=0))) < 1e-9
    assert standing_pose(state) is None and "Click a row" in LookAtStanding(None).run(_Eye(state)).notices[-1].text


def test_the_background_works_out_what_is_wanted_last_and_asks_once():
    heard, done = [], threading.Event()

    def work(number):
        if number == 2:
            raise ArithmeticError("on purpose")
        return 10 * number

    worker = Background(
        lambda said: (heard.append(said), said[0] == (3,) and done.set()), lambda wanted: wanted, work, lambda asked, out: (asked, out)
    )
    try:
        for wanted in (None, (1,), (1,)):
            worker.follow(wanted)
        worker._asked.result(10.0)
        worker.follow((2,))
        assert worker._asked.exception(10.0) is not None
        worker.follow((3,))
        assert done.wait(10.0)
    finally:
        worker.stop()
    assert heard == [((1,), 10), ((2,), None), ((3,), 30)]


class _Eye:
    """A bench that remembers where it was told to look."""

    def __init__(self, state):
        self.state, self.looked = state, []

    def look(self, position, look_at, client):
        self.looked.append((position, look_at, client))
