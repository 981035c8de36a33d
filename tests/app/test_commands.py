"""The workbench's state without a browser: what commands make of it, undo, playing, filtering."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.app.browsing import chosen, ledger_page, listed
from handey_studio.app.commands import Redo, Undo
from handey_studio.app.guidance import next_step
from handey_studio.app.jobs import JobDone, JobFailed, JobProgress, JobShows, JobStarted
from handey_studio.app.ledger_commands import FilterLedger, LedgerPage, LedgerReason, LedgerRow, LedgerUp, LookAtNoEntry
from handey_studio.app.looking_at import PointAt, Select, ShowLayer
from handey_studio.app.playback import Seek, SeekStep, SetPlayback, Tick, TogglePlay
from handey_studio.app.ruler import HOW, ClickPart, ToggleRuler, ruler_words
from handey_studio.app.setting_up import ChoosePart, ChooseRobot, DropGhost, FreePose, ResetCell, SetDestination, SetSeed
from handey_studio.app.settings import Settings
from handey_studio.app.state import MAX_UNDO, opened
from handey_studio.base import BadInput, Ledger, rejected_counts
from handey_studio.geometry.transforms import apply, from_xyz_rpy, to_xyz_rpy
from handey_studio.session.destination import destination_pose, snapped
from handey_studio.session.ledger_tree import ROOT
from tests.session.samples import fresh_session, full_session, library


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("library")


@pytest.fixture(scope="module")
def fresh(folder):
    return opened(library(folder), fresh_session(folder), None)


@pytest.fixture(scope="module")
def full(folder):
    return opened(library(folder), full_session(folder), None)


def after(state, *commands):
    for command in commands:
        state = command.apply(state)
    return state


SETTERS = st.one_of(
    st.sampled_from(["l_block", "brick"]).map(ChoosePart),
    st.tuples(*[st.integers(-500, 500)] * 3).map(lambda xyz: SetDestination(",".join(str(n / 1000) for n in xyz))),
    st.integers(0, 1000).map(SetSeed),
    st.just(FreePose()),
)


@given(st.lists(SETTERS, max_size=8))
@settings(max_examples=60, deadline=None)
def test_undo_goes_back_through_every_setting_and_redo_forth(fresh, commands):
    history, state = [Settings.of(fresh.session)], fresh
    for command in commands:
        state = command.apply(state)
        if Settings.of(state.session) != history[-1]:
            history.append(Settings.of(state.session))
    for past in history[-2::-1]:
        state = Undo().apply(state)
        assert Settings.of(state.session) == past
    assert not state.undo and Undo().apply(state) is state
    for future in history[1:]:
        state = Redo().apply(state)
        assert Settings.of(state.session) == future
    assert not state.redo and Redo().apply(state) is state


def test_a_new_change_ends_redo_and_undo_is_bounded(fresh):
    state = after(fresh, SetSeed(1), SetSeed(2), Undo(), SetSeed(3))
    assert not state.redo and state.session.seed == 3
    for seed in range(MAX_UNDO + 20):
        state = SetSeed(seed + 10).apply(state)
    assert len(state.undo) == MAX_UNDO


def test_undo_leaves_what_was_found_alone(full):
    state = after(full, SetSeed(1), Undo())
    assert state.session.scene is full.session.scene and state.session.results is full.session.results


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (ChoosePart("ghost"), 'part "ghost" is not in this workcell; it has l_block, brick.'),
        (SetDestination("1,2"), "it takes 3 or 6"),
        (SetDestination("nan,0,0"), "it takes 3 or 6 finite"),
        (SetDestination("on:moon"), '"moon" is not known'),
        (SetSeed(-1), "the seed is -1"),
    ],
)
def test_what_means_nothing_is_told_in_a_sentence(fresh, command, words):
    with pytest.raises(BadInput, match=words):
        command.apply(fresh)


def test_a_ghost_let_go_snaps_to_the_table(fresh):
    T = from_xyz_rpy((0.30049, -0.1, 0.0071), (0.03, -0.02, 0.5))
    state = DropGhost(T).apply(fresh)
    pose = destination_pose(state.session, state.command)
    xyz, rpy = to_xyz_rpy(pose)
    np.testing.assert_allclose(xyz[:2], (0.300, -0.1), atol=1e-9)
    np.testing.assert_allclose(np.rad2deg(rpy), (0, 0, 29), atol=1e-3)
    assert abs(state.session.part("l_block").lowest(pose)) < 1e-5
    assert state.undo[-1].label == "drag destination"
    assert DropGhost(2 * np.eye(4)).apply(state) is state


@given(st.tuples(*[st.floats(-0.5, 0.5)] * 3), st.tuples(*[st.floats(-3.1, 3.1)] * 3))
@settings(max_examples=80, deadline=None)
def test_snapping_twice_is_snapping_once_and_never_goes_below_the_table(fresh, xyz, rpy):
    part = fresh.session.part("l_block")
    once = snapped(part, from_xyz_rpy(xyz, rpy), 0.0)
    assert part.lowest(once) > -1e-9
    if abs(abs(to_xyz_rpy(once)[1][1]) - np.pi / 2) > 0.1:  # at pitch ±90° roll and yaw are one
        twice = snapped(part, once, 0.0)
        assert np.abs(twice - once).max() < 2e-3


def test_a_destination_on_a_part_waits_until_that_part_is_located(fresh, full):
    assert destination_pose(fresh.session, SetDestination("on:l_block:block").apply(fresh).command) is None
    state = FreePose().apply(SetDestination("on:l_block:block").apply(full))
    assert not state.command.to.startswith("on:")


def test_one_time_drives_playing(full):
    state = after(full, TogglePlay(), Tick(1.0), SetPlayback(speed=3.0), Tick(1.0))
    assert state.playing and state.session.view.time_s == pytest.approx(4.0)
    state = Tick(10.0).apply(state)
    assert not state.playing and state.session.view.time_s == pytest.approx(10.0)
    assert TogglePlay().apply(state).session.view.time_s == 0.0
    assert after(state, SeekStep(-1)).session.view.time_s == pytest.approx(8.0)
    assert after(state, SeekStep(-99), SeekStep(1)).session.view.time_s == pytest.approx(2.0)
    assert after(state, Seek(-3.0)).session.view.time_s == 0.0


def test_without_a_plan_nothing_plays(fresh):
    state = after(fresh, TogglePlay(), Tick(1.0), SeekStep(1), Seek(4.0))
    assert not state.playing and state.session.view.time_s == 0.0


def test_late_words_of_an_old_job_are_not_heard(full):
    state = JobStarted(False).apply(full)
    old = state.job.number - 1
    for message in (JobProgress(old, 0.5, "x"), JobShows(old, full.session), JobDone(old, full.session), JobFailed(old, "x")):
        assert message.apply(state) is state
    assert JobProgress(state.job.number, 0.5, "x").apply(state).job.fraction == 0.5


def test_settings_changed_while_planning_stay(full):
    state = after(JobStarted(True).apply(full), SetSeed(99))
    state = JobDone(state.job.number, full.session).apply(state)
    assert state.session.seed == 99 and state.job is None and state.playing
    assert state.session.scene is full.session.scene


def test_reset_forgets_what_was_found_but_not_what_was_set(full):
    state = after(full, SetSeed(5), ResetCell())
    assert state.session.scene is None and not state.session.results and state.session.seed == 5
    with pytest.raises(BadInput):
        ResetCell().apply(JobStarted(False).apply(full))


def test_a_click_on_an_edge_looks_at_it(full):
    middle = full.session.scene.located.edges[1].ends_world.mean(axis=0)
    origin = middle + np.array([0.3, -0.4, 0.5])
    assert PointAt(origin, middle - origin).apply(full).session.view.edge == 1
    beside = middle + np.array([0.03, 0.03, 0.0])
    assert PointAt(origin, beside - origin).apply(full) is full
    hidden = ShowLayer("data edges", False).apply(full)
    assert PointAt(origin, middle - origin).apply(hidden) is hidden


def test_the_ruler_takes_clicks_to_itself_until_it_is_put_away(full):
    def click(spot):
        return PointAt(spot + np.array([0.1, -0.2, 0.5]), np.array([-0.1, 0.2, -0.5]))

    corner = apply(full.session.located[0].T_world_part, full.session.located[0].part.solid.vertices)
    corner = corner[np.argmax(corner @ [0.1, -0.2, 0.5])]  # the one nearest to where the clicks come from
    state = after(full, ToggleRuler(), click(corner + 0.001), click(np.array([0.9, 0.9, 0.0])), ClickPart("nothing of that name"))
    assert state.ruler is not None and state.session is full.session
    assert np.allclose(state.ruler, [corner, [0.9, 0.9, full.session.workcell.table_z]], atol=1e-9)
    assert f"{1e3 * np.linalg.norm(state.ruler[1] - state.ruler[0]):.1f} mm apart" in ruler_words(state.ruler)
    assert len(after(state, click(corner)).ruler) == 1 and after(state, ToggleRuler()).ruler is None
    assert ruler_words(()) == HOW


def test_hiding_and_showing_a_layer(full):
    before = full.session.view.hidden_layers
    state = after(full, ShowLayer("robot", False), ShowLayer("robot", False))
    assert state.session.view.hidden_layers == (*before, "robot")
    assert ShowLayer("robot", True).apply(state).session.view.hidden_layers == before


def test_looking_does_not_make_a_session_unsaved(full):
    state = replace(full, saved=full.session)
    assert not after(state, Seek(3.0), Select("hypothesis", 1), ShowLayer("robot", False)).unsaved
    assert SetSeed(3).apply(state).unsaved and not after(state, SetSeed(3), Undo()).unsaved


def test_the_ledger_is_filtered_by_stage_outcome_and_words(full):
    entries = full.session.results[0].ledger
    assert len(chosen(entries, "", "all", "")) == 6
    assert {e.stage for e in chosen(entries, "grasp", "fell", "")} == {"grasp"}
    assert len(chosen(entries, "", "fell", "FACES tilted")) == 3
    assert [e.option for e in chosen(entries, "grasp", "stood", "")] == ["faces 0 and 5 at 0°"]
    reasons = rejected_counts(entries)
    for row, (reason, count) in enumerate(reasons.items()):
        state = LedgerReason(row).apply(full)
        assert [entry.reason for entry in listed(state)] == [reason] * count
        assert listed(LedgerReason(row).apply(state)) == listed(full)
    assert len(reasons) > 1 and LedgerReason(99).apply(full) is full
    assert len(FilterLedger(words="x" * 500).apply(full).ledger_words) == 80


def test_every_state_says_what_to_do_next(fresh, full):
    bare = replace(fresh, session=replace(fresh.session, commands=()))
    failed = replace(full.session.results[0], status="failed", reason="no grasp.", plan=None)
    no_plan = replace(full, session=replace(full.session, results=(failed,)))
    titles = [next_step(s)[0] for s in (fresh, full, bare, no_plan, JobStarted(True).apply(full), SetDestination("0,0,0").apply(full))]
    assert len(set(titles)) == len(titles)
    assert "No grasp." in next_step(no_plan)[1]


def test_a_part_that_the_search_did_not_find_is_not_ready_to_move(full):
    sensed = replace(full, session=replace(full.session, results=()))
    assert next_step(sensed)[0] == "Ready to MOVE"
    nothing = replace(sensed, session=replace(sensed.session, scene=replace(sensed.session.scene, instances=())))
    title, words, tone = next_step(nothing)
    assert title == f"{nothing.command.part} was not found" and "Located" in words and tone == "bad"


def tree_of(full):
    """A state whose ledger has two destinations, one with twenty groups, the last of which has an approach below it."""
    book = Ledger()
    here, there = book.add("destination", "here"), book.add("destination", "there", "outside")
    groups = [book.add("grasp group", f"edge {k}", "too narrow" if k % 2 else None, parent=here) for k in range(20)]
    book.add("approach", "hand at 5°", "stuck", parent=groups[-1], value=0.01, limit=0.002, unit="m")
    result = replace(full.session.results[0], ledger=book.entries)
    view = replace(full.session.view, result=-1)
    return replace(full, session=replace(full.session, results=(result,), view=view)), here, there, groups


def test_the_ledger_is_a_tree_that_opens_row_by_row(full):
    state, here, there, groups = tree_of(full)
    assert [entry.id for entry in listed(state)] == [here, there]
    state = LedgerRow(1).apply(state)
    assert state.entry.id == there and state.ledger_at == ROOT, "nothing is below it"
    state = LedgerRow(0).apply(state)
    assert state.entry.id == here and len(listed(state)) == 20 and len(ledger_page(state)) < 20
    for _ in range(9):
        state = LedgerPage(1).apply(state)
    assert ledger_page(state)[-1].id == groups[-1]
    state = LedgerRow(len(ledger_page(state)) - 1).apply(state)
    assert state.ledger_at == groups[-1] and [entry.option for entry in listed(state)] == ["hand at 5°"]
    state = after(state, LedgerRow(0), LedgerRow(7))
    assert state.entry.reason == "stuck" and LookAtNoEntry().apply(state).entry is None
    assert after(state, LedgerUp()).ledger_at == here and after(state, LedgerUp(), LedgerUp(), LedgerUp()).entry is None


def test_another_robot_takes_its_plans_away_and_comes_back_by_undo(full):
    state = ChooseRobot("ur10").apply(full)
    assert (
        state.robot.name == state.session.workcell.robot == "ur10"
        and not state.session.results
        and state.session.scene is full.session.scene
    )
    back = Undo().apply(state)
    assert back.robot == full.robot and back.session.workcell.robot == "ur5"
    with pytest.raises(BadInput, match="robot"):
        ChooseRobot("r2d2").apply(full)
