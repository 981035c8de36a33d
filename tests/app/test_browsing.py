"""Browsing the localizer's work without a browser: lists, filters, clicks into the scene, explanations, and what is written of them."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from handey_studio.app.browsing import ROWS, browsed_hypotheses, edges_shown, page_of, wired
from handey_studio.app.commands import Undo
from handey_studio.app.explaining import Explainer
from handey_studio.app.jobs import merged
from handey_studio.app.looking_at import Browse, BrowseRow, FilterEdges, FilterHypotheses, LookAt, PointAt, Select, ShowLayer
from handey_studio.app.palette import residual_colours
from handey_studio.app.panels.edges import about_edge, edge_labels, edges_legend, number_of
from handey_studio.app.panels.explained import explained_html
from handey_studio.app.panels.rows import hypothesis_rows, percent
from handey_studio.app.panels.sensing import found_html
from handey_studio.app.scene.pair import parameter_texts, parameters
from handey_studio.app.setting_up import ChoosePart
from handey_studio.app.state import Explained, opened, with_view
from handey_studio.app.viewpoints import CLOSE_UP, Follow, LookFrom, middle_of
from handey_studio.base import Entry
from handey_studio.geometry.transforms import from_xyz_rpy, transform
from handey_studio.localization import Hypothesis, LocatedPose, Rival
from handey_studio.session import session_from_bytes, session_to_bytes
from handey_studio.session.looking import cells_of, explained, wires_of
from tests.session.samples import full_session, library

MISSING = "edges that should be seen are missing"


def many(state):
    """The sample's scene with 2 accepted and 14 fallen hypotheses, each well apart from the others."""
    scene = state.session.scene
    entry = Entry(0, None, "verify", "brick from edges 0 and 1", MISSING, 0.31, 0.5, "")
    fallen = [
        Hypothesis("brick", from_xyz_rpy((0.30 + 0.15 * k, 0.12, 0.0)), 0.3, 0.05, 0.11, (0, 1), MISSING, (2, 3), 0) for k in range(14)
    ]
    accepted = scene.located.hypotheses[0]
    twin = replace(accepted, T_world_part=from_xyz_rpy((0.40, -0.15, 0.0)))
    located = replace(scene.located, hypotheses=(accepted, twin, *fallen), ledger=(entry,))
    return replace(state, session=replace(state.session, scene=replace(scene, located=located)))


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    folder = tmp_path_factory.mktemp("library")
    return opened(library(folder), full_session(folder), None)


@pytest.fixture(scope="module")
def browsing(full):
    return many(full)


def after(state, *commands):
    for command in commands:
        state = command.apply(state)
    return state


def number(state):
    return state.session.view.hypothesis


def test_next_and_previous_go_through_all_and_begin_again(browsing):
    state, seen = browsing, []
    for _ in range(16):
        state = Browse(1).apply(state)
        seen.append(number(state))
    assert seen == list(range(16)) and number(Browse(1).apply(state)) == 0
    assert number(Browse(-1).apply(browsing)) == 15 and number(after(browsing, Browse(1), Browse(-1))) == 15
    assert LookAt(99).apply(state).hypothesis is None


def test_filters_narrow_down_the_list_and_what_is_looked_at(browsing):
    state = after(browsing, LookAt(0), FilterHypotheses(verdict=MISSING))
    assert browsed_hypotheses(state) == tuple(range(2, 16)) and number(state) == 2
    state = after(state, FilterHypotheses(part="l_block", verdict="accepted"))
    assert browsed_hypotheses(state) == (0, 1) and number(state) == 0
    state = after(state, FilterHypotheses(part="brick"))
    assert browsed_hypotheses(state) == () == page_of(state) and number(state) == -1
    assert after(state, FilterHypotheses(part="", verdict="")).hypothesis is None
    assert browsed_hypotheses(FilterHypotheses(part="gone").apply(browsing)) == tuple(range(16))


def test_a_row_looks_at_its_hypothesis_and_the_page_follows(browsing):
    state = after(browsing, LookAt(ROWS + 1))
    assert page_of(state) == tuple(range(ROWS, 2 * ROWS))
    assert number(BrowseRow(3).apply(state)) == ROWS + 3
    assert number(BrowseRow(1).apply(state)) == -1, "a second click no longer looks at it"
    last = LookAt(15).apply(browsing)
    assert BrowseRow(ROWS - 1).apply(last) is last, "there is no such row on the last page"


def test_looking_is_no_edit(browsing):
    saved = replace(browsing, saved=browsing.session)
    state = after(saved, Browse(1), FilterHypotheses(part="brick"), FilterEdges(0.03), Select("edge", 0))
    assert not state.unsaved and not state.undo


def test_setting_up_a_move_ends_the_looking_and_undo_takes_back_the_move_alone(browsing):
    state = after(browsing, LookAt(3), ChoosePart("brick"))
    assert state.hypothesis is None and state.command.part == "brick"
    state = after(state, LookAt(5), Undo())
    assert state.command.part == "l_block" and number(state) == 5


def towards(point):
    origin = point + np.array([0.3, -0.4, 0.5])
    return PointAt(origin, point - origin)


def test_a_click_on_a_wire_looks_at_its_hypothesis_and_further_clicks_at_the_next_there(browsing):
    corner = wires_of(browsing.session.scene.located.hypotheses[7], browsing.session.parts)[0, 0]
    click = towards(corner)
    assert number(click.apply(browsing)) == -1, "no wires stand in the scene before one is looked at"
    state = click.apply(LookAt(0).apply(browsing))
    assert number(state) == 7
    hidden = after(browsing, LookAt(0), ShowLayer("other hypotheses", False))
    assert wired(hidden) == () and number(click.apply(hidden)) == 0
    scene = browsing.session.scene
    double = replace(scene.located, hypotheses=(*scene.located.hypotheses, replace(scene.located.hypotheses[7], score=0.2)))
    twice = replace(browsing, session=replace(browsing.session, scene=replace(scene, located=double)))
    state, seen = LookAt(0).apply(twice), set()
    for _ in range(4):
        state = click.apply(state)
        seen.add(number(state))
    assert seen == {7, 16}


def test_short_edges_are_neither_shown_nor_clicked(browsing):
    lengths = [edge.length for edge in browsing.session.scene.located.edges]
    state = after(browsing, Select("edge", 1), FilterEdges(0.05))
    assert edges_shown(state) == [0] and lengths[0] > 0.05 > lengths[1]
    assert state.session.view.edge == -1, "it is no longer shown"
    middle = state.session.scene.located.edges[1].ends_world.mean(axis=0)
    assert towards(middle).apply(state) is state
    assert towards(middle).apply(browsing).session.view.edge == 1
    assert "1 of 2 jump" in edges_legend(state) and "2 jump" in edges_legend(browsing) and "0 convex" in edges_legend(state)
    assert [number_of(label) for label in edge_labels(state)] == [-1, 0]
    assert "44.7 mm" in about_edge(after(browsing, Select("edge", 1)))


def test_an_explanation_comes_from_the_stored_depth_map_and_is_the_same_after_reload(full):
    session = full.session
    said = explained(session.scene, session.parts, 0)
    back = session_from_bytes(session_to_bytes(session), "x")
    assert back.scene is not session.scene and explained(back.scene, back.parts, 0) == said
    assert said.data_pair is not None and said.model_pair is not None and len(said.distance) > 0
    assert explained(session.scene, session.parts, 2) is None is explained(session.scene, session.parts[1:], 0)
    odd = replace(session.scene.located.hypotheses[0], data=(0, 77), model=(0, 9999))
    located = replace(session.scene.located, hypotheses=(odd,))
    assert explained(replace(session.scene, located=located), session.parts, 0).data_pair is None


def test_the_explainer_answers_what_is_looked_at_and_asks_once(full):
    heard, arrived = [], threading.Event()
    explainer = Explainer(lambda command: (heard.append(command), arrived.set()))
    try:
        explainer.follow(full)
        state = LookAt(1).apply(full)
        for _ in range(3):
            explainer.follow(state)
        assert arrived.wait(120.0)
    finally:
        explainer.stop()
    assert len(heard) == 1
    state = heard[0].apply(state)
    assert state.explanation is not None
    assert LookAt(0).apply(state).explanation is None, "it speaks of another hypothesis"


def test_a_scene_that_comes_again_stays_and_of_a_new_one_nothing_is_looked_at(full):
    looking = with_view(full, hypothesis=1, edge=0).session
    again = session_from_bytes(session_to_bytes(looking), "x")
    assert merged(looking, again).scene is looking.scene and merged(looking, again).view.hypothesis == 1
    other = replace(again, scene=replace(again.scene, instances=()))
    assert merged(looking, other).scene is other.scene and merged(looking, other).view.hypothesis == -1


class Eye:
    """A bench that remembers where it was told to look."""

    def __init__(self, state):
        self.state, self.looked = state, []

    def look(self, position, look_at, client):
        self.looked.append((position, look_at, client))


def test_a_camera_that_is_close_to_a_hypothesis_goes_along_to_the_next(browsing):
    bench = Eye(LookAt(2).apply(browsing))
    Follow(Browse(1), 5).run(bench)
    assert not bench.looked, "from afar it stays"
    LookFrom("Hypothesis", 5).run(bench)
    position, look_at, _ = bench.looked.pop()
    middle = middle_of(bench.state, bench.state.hypothesis)
    np.testing.assert_allclose(look_at, middle)
    diameter = bench.state.session.part("brick").solid.diameter
    assert np.linalg.norm(position - look_at) == pytest.approx(CLOSE_UP * diameter, rel=0.01)
    bench.state = with_view(bench.state, camera_position=position, camera_look_at=look_at)
    after_it = Follow(Browse(1), 5).run(bench)
    assert number(after_it) == 3
    np.testing.assert_allclose(bench.looked[0][1], look_at + np.array([0.15, 0.0, 0.0]))
    np.testing.assert_allclose(bench.looked[0][0] - bench.looked[0][1], position - look_at)


def test_the_list_tells_the_reason_with_its_number_and_presses_the_button_of_its_row(browsing):
    state = LookAt(2).apply(browsing)
    page = page_of(state)
    text = hypothesis_rows(state.session.scene, page, browsed_hypotheses(state), 2, [f"b{k}" for k in range(ROWS)])
    assert f"{MISSING}: 0.31, limit 0.5" in text and f"1 to {ROWS} of 16" in text
    assert text.count("onclick=") == ROWS and "getElementById(&#x27;b2&#x27;)" in text
    assert 'data-testid="hypothesis-2"' in text and text.count('aria-pressed="true"') == 1
    assert [percent(p) for p in (0.0004, 0.5, 0.9999)] == ["< 1 %", "50 %", "> 99 %"]


def test_what_the_view_says_is_written_with_units_and_nothing_of_it_is_markup(full):
    evil = "<script>alert(1)</script>"
    state = LookAt(0).apply(full)
    assert "Looking at the depth map" in explained_html(state) and "Click a hypothesis" in explained_html(full)
    said = explained(state.session.scene, state.session.parts, 0)
    told = replace(state, explained=Explained(state.session.scene, 0, said))
    text = explained_html(told)
    assert "found" in text and "within the limit" in text and "+2.5 mm" in text
    names = [name for name, *_ in parameters(said)]
    assert names == ["α", "d", "a1", "a2"] and all(data in text and model in text for _, data, model in parameters(said))
    texts = parameter_texts(said)
    assert "(model 90.0°)" in texts["α"] and texts["d"].endswith(" mm") and texts["a2"].startswith("a2 ")
    bad = replace(state.session.scene.located.hypotheses[0], part=evil, reason=evil)
    scene = replace(state.session.scene, located=replace(state.session.scene.located, hypotheses=(bad,)))
    nasty = replace(state, session=replace(state.session, scene=scene))
    assert "<script" not in explained_html(nasty) + hypothesis_rows(scene, (0,), (0,), 0, ["b"])
    assert "has no model of this part" in explained_html(nasty)


def test_residual_colours_are_white_where_readings_agree_and_stay_beyond_the_limit():
    behind, agree, before, far = residual_colours(np.array([-1.0, 0.0, 1.0, 9.0])).astype(int)
    assert agree.min() > 240 and behind[2] > behind[0] + 80 and before[0] > before[2] + 80
    assert (far == before).all()


def test_cells_of_points_are_those_of_the_map(full):
    scan = full.session.scan
    points = scan.points_world()
    np.testing.assert_array_equal(cells_of(scan, points), np.isfinite(scan.elevation))
    outside = transform(translation=(1.0, 0.0, 0.0))[:3, 3] + points[:1]
    assert not cells_of(scan, outside).any()


def test_looking_at_the_configuration_space_shows_it(browsing):
    bench = Eye(browsing)
    assert "configuration space" in browsing.session.view.hidden_layers
    assert "configuration space" not in LookFrom("C-space", None).run(bench).session.view.hidden_layers


def test_what_a_located_part_could_also_be_is_told_and_kept(full):
    """In the row of the part and in that of its hypothesis; a saved session says the same."""
    located, T = full.session.scene.located, from_xyz_rpy((0.3, 0.1, 0.0))
    rivals = (Rival("brick", T, 0.31), Rival("l_block", T, 0.124))
    poses = (LocatedPose("l_block", T, T, 0.6, 9, 9, 0.8, 0.0004, rivals=rivals),)
    hypotheses = (replace(located.hypotheses[0], rivals=rivals),)
    scene = replace(full.session.scene, located=replace(located, poses=poses, hypotheses=hypotheses))
    session = replace(full.session, scene=scene)
    words = "could also be brick (31 %), the same, placed otherwise (12 %)"
    assert words in found_html(session) and f"accepted, {words}" in hypothesis_rows(scene, (0,), (0,), 0, ())
    assert "could also be" not in found_html(full.session)
    kept = session_from_bytes(session_to_bytes(session), "kept")
    assert kept.scene is not None and kept.scene.located.poses == poses and kept.scene.located.hypotheses == hypotheses
