"""Execution on screen, without a browser: what really happened, the list of commands, disturbances, calibration, export, autosave."""

import re
import time
from dataclasses import replace

import numpy as np
import pytest

from handey_studio.app import autosave
from handey_studio.app.autosave import Autosave, LetGo, Offer, TakeUp, left_behind, own_copy
from handey_studio.app.browsing import ledger_page
from handey_studio.app.calibrating import AcceptCalibration, Misplace, calibration_done
from handey_studio.app.commands import Redo, Undo
from handey_studio.app.compared import is_misplaced, with_outcome
from handey_studio.app.disturbing import KINDS, AddFault, ClearFaults, SetPhysics, which_words, words_of
from handey_studio.app.exporting import exported
from handey_studio.app.happened import LookAtHappening, happenings
from handey_studio.app.jobs import JobDone, JobShows, JobStarted
from handey_studio.app.ledger_commands import FilterLedger
from handey_studio.app.looking_back import looking_back
from handey_studio.app.panels.calibration import found_html, off_words, outcomes_html, residuals_svg
from handey_studio.app.panels.commands import commands_html
from handey_studio.app.panels.running import happened_html
from handey_studio.app.panels.timeline import now_playing
from handey_studio.app.pictures.plots import cursor, plots_html, plots_of
from handey_studio.app.playback import LookAtAttempt, Seek, Tick, TogglePlay
from handey_studio.app.sequence import (
    AddCommand,
    ChooseCommand,
    RemoveCommand,
    RunCommands,
    ShiftCommand,
    SkipCommand,
    StartOver,
    commands_done,
)
from handey_studio.app.setting_up import SetAttempts, SetDestination, SetImprove, SetSeed
from handey_studio.app.state import opened, with_view
from handey_studio.app.tabs import tabs_with_news
from handey_studio.base import BadInput
from handey_studio.cell.workcell import TrueBody
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.sensing.frame_fit import FrameFit
from handey_studio.session import CommandState, session_to_bytes, write_session
from handey_studio.session.calibrating import really_at
from handey_studio.session.sequence import states_of
from handey_studio.task.calibrating.calibrate import RangeCalibration
from handey_studio.task.export import FORMS, read_csv
from tests.session.samples import fresh_session, full_session, library, performed_session


@pytest.fixture
def state(tmp_path):
    return opened(library(tmp_path), fresh_session(tmp_path), None)


@pytest.fixture
def done(tmp_path):
    return opened(library(tmp_path), performed_session(tmp_path), None)


def after(state, *commands):
    for command in commands:
        state = command.apply(state)
    return state


def numbers(state):
    return [command.to for command in state.session.commands]


# what really happened


def test_attempts_play_one_after_the_other_and_again_from_the_first(done):
    state = after(done, LookAtAttempt(0), TogglePlay(), Tick(7.1))
    assert state.attempt_number == 1 and state.playing and state.session.view.time_s == 0.0
    state = Tick(100.0).apply(state)
    assert not state.playing and state.session.view.time_s == pytest.approx(state.replay.duration)
    assert TogglePlay().apply(state).attempt_number == 0


def test_what_happened_is_told_in_order_and_each_row_seeks_there(done):
    rows = happenings(done)
    assert [row.kind for row in rows] == ["incident", "decision", "check"]
    assert "2 of 3 attempts are left" in rows[1].sentence and "ruled out from now on: this grasp" in rows[1].sentence
    state = LookAtHappening(0).apply(done)
    assert state.attempt_number == 0 and state.session.view.time_s == pytest.approx(7.0)
    assert "nobody knows where the part is" in now_playing(state)
    assert LookAtHappening(2).apply(state).attempt_number == 1 and LookAtHappening(99).apply(state) is state


def test_words_from_files_are_no_markup(done):
    evil = "<script>alert(1)</script>"
    result = done.session.results[0]
    attempt = result.attempts[0]
    incident = replace(attempt.recovery.incident, sentence=evil)
    recovery = replace(attempt.recovery, incident=incident, why=evil, actions=(evil,))
    performance = replace(attempt.performance, incidents=(incident,))
    result = replace(result, attempts=(replace(attempt, performance=performance, recovery=recovery),))
    commands = (replace(done.session.commands[0], to=evil),)
    evil_state = replace(done, session=replace(done.session, results=(result,), commands=commands))
    shown = happened_html(evil_state, ["b"] * 9) + commands_html(evil_state, 0, ["b"] * 3)
    assert "<script" not in shown and "&lt;script" in shown


def test_plots_show_the_curves_in_their_units_with_contacts_and_limits(done):
    replay = done.replay
    force, width, off = plots_of(replay)
    assert force.curves[0].values.min() == pytest.approx(-8.0) and width.curves[0].values.max() == pytest.approx(100.0)
    assert 0.1 < off.curves[0].values.max() < 6.0
    picture = plots_html(replay)
    assert picture.count("▼ 8 N") == 2 and picture.count('data-limit="42.5"') == 1 and picture.count('data-limit="37.5"') == 1
    assert len(picture) < 200_000
    left = [float(re.search(r"left:([\d.]+)%", cursor(replay, t))[1]) for t in (0.0, 6.0, 12.0)]
    np.testing.assert_allclose(left, (0.0, 50.0, 100.0))


def test_a_contact_stands_where_it_was_felt_on_the_time_axis(done):
    shares = [float(share) for share in re.findall(r"position:absolute;left:([\d.]+)%;transform", plots_html(done.replay))]
    np.testing.assert_allclose(shares, [100 * 4.5 / 12.0, 100 * 7.0 / 12.0], atol=0.01)


# the list of commands


def test_commands_are_added_changed_moved_and_removed_and_each_is_one_undo(state):
    first = state.session.commands[0]
    state = after(state, AddCommand(), SetDestination("0.40,0.30,0"))
    assert state.session.commands[0] == first and state.command.to == "0.40,0.30,0" and state.command.part == "brick"
    state = ShiftCommand(-1).apply(state)
    assert state.session.commands[1] == first and state.command_number == 0
    state = RemoveCommand().apply(state)
    assert state.session.commands == (first,)
    with pytest.raises(BadInput, match="only this command"):
        RemoveCommand().apply(state)
    for expected in (2, 2, 2, 1):
        state = Undo().apply(state)
        assert len(state.session.commands) == expected
    assert len(Redo().apply(state).session.commands) == 2


def run_so_far(state, *statuses):
    """A list that was run so far: done and failed ones have results."""
    result = performed_session(state.library.folder).results[0]
    results, states = [], []
    for command, status in zip(state.session.commands, statuses, strict=True):
        ran = status in ("done", "failed")
        if ran:
            results.append(replace(result, command=command, status=status, reason="" if status == "done" else "the hand is stuck"))
        states.append(CommandState(status, len(results) - 1 if ran else -1))
    return replace(state.session, results=tuple(results), states=tuple(states))


def listed(state):
    return after(state, AddCommand(), SetDestination("0.40,0.30,0"), AddCommand(), SetDestination("0.40,0.20,0"))


def test_what_is_done_stays_done_when_others_change_places(state):
    state = listed(state)
    state = replace(state, session=run_so_far(state, "done", "failed", "waiting"))
    state = after(state, ChooseCommand(0), ShiftCommand(1))
    assert [one.status for one in states_of(state.session)] == ["failed", "done", "waiting"]
    state = after(state, ChooseCommand(1), SetDestination("0.41,0.33,0"))
    assert [one.status for one in states_of(state.session)] == ["failed", "waiting", "waiting"]
    assert states_of(Undo().apply(state).session)[0].status == "failed"


def test_skipped_commands_are_passed_over_and_start_over_lets_all_wait(state):
    state = after(listed(state), ChooseCommand(1), SkipCommand())
    assert states_of(state.session)[1].status == "skipped"
    assert states_of(SkipCommand().apply(state).session)[1].status == "waiting"
    assert {one.status for one in states_of(StartOver().apply(state).session)} == {"waiting"}


class Bench:
    """What an action needs: the state, and a planner that only listens."""

    def __init__(self, state):
        self.state, self.planner, self.orders = state, self, []

    def order(self, *given):
        self.orders.append(given)

    def client(self, number):
        return None

    def look(self, *_):
        pass


def test_a_run_shows_states_as_they_come_and_says_where_it_stopped(state):
    state = listed(state)
    bench = Bench(state)
    running = RunCommands().run(bench)
    assert running.job.title == "Running the commands" and len(bench.orders) == 1
    with pytest.raises(BadInput, match="at work"):
        AddCommand().apply(running)
    shown = JobShows(running.job.number, run_so_far(state, "done", "running", "waiting")).apply(running)
    assert shown.session.view.time_s == pytest.approx(shown.replay.duration), "where the cell is now"
    assert 'data-status="running"' in commands_html(shown, 0, ["b"] * 5)
    ended = JobDone(running.job.number, run_so_far(state, "done", "failed", "waiting")).apply(shown)
    assert ended.job is None and "Command 2 of 3" in ended.notices[-1].text and ended.notices[-1].kind == "bad"
    assert ended.command_number == 1 and "the hand is stuck" in commands_html(ended, 0, ["b"] * 5)
    finished = commands_done(shown, run_so_far(state, "done", "done", "done"))
    assert finished.notices[-1].text == "All 3 commands are done."
    with pytest.raises(BadInput, match="every command is done"):
        RunCommands().run(Bench(replace(finished, job=None)))


def test_a_single_move_of_a_list_leaves_the_others_as_they_are(state):
    state = listed(state)
    state = replace(state, session=run_so_far(state, "done", "waiting", "waiting"), chosen=1)
    job = JobStarted(True).apply(state)
    alone = replace(job.session, commands=(job.command,), states=(), results=())
    result = replace(performed_session(state.library.folder).results[0], command=job.command)
    ended = JobDone(job.job.number, replace(alone, results=(result,))).apply(job)
    assert [one.status for one in states_of(ended.session)] == ["done", "done", "waiting"] and len(ended.session.results) == 2
    assert len(session_to_bytes(ended.session)) > 0, "the states and results agree"


# the cell


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_each_disturbance_is_set_told_and_cleared_by_one_undo_each(state, kind):
    disturbed = AddFault(kind.name, kind.usual, kind.call, kind.count, 0.3).apply(state)
    (fault,) = disturbed.session.workcell.setup.faults
    assert fault.kind == kind.name and "0.3 s into" in words_of(fault)
    assert disturbed.session.workcell.setup.bodies == state.session.workcell.setup.bodies
    cleared = ClearFaults().apply(disturbed)
    assert cleared.session.workcell.setup.faults == ()
    assert Undo().apply(cleared).session.workcell.setup.faults == (fault,)
    with pytest.raises(BadInput, match="must be from"):
        AddFault(kind.name, kind.most + 1, kind.call, 1, 0.0).apply(state)


def test_physics_are_switched_and_switched_back(state):
    other = not state.session.workcell.setup.physics
    switched = SetPhysics(other).apply(state)
    assert switched.session.workcell.setup.physics is other
    assert Undo().apply(switched).session.workcell.setup.physics is not other


def test_budgets_are_settings_within_their_limits(state):
    changed = after(state, SetAttempts(99), SetImprove(4), SetSeed(11))
    assert (changed.session.attempts, changed.session.improve) == (20, 4)
    assert after(changed, Undo(), Undo(), Undo()).session.attempts == 3


def found_at(T):
    residuals = np.array([[1e-4, 0, 0], [0, 2e-4, 0], [0, 0, 8e-4]])
    fit = FrameFit(
        T, np.zeros(3), residuals, np.array([True, True, False]), np.full(3, 5e-5), np.full(3, 1e-4), np.full(3, 0.1), ("mind this",)
    )
    return RangeCalibration("found", "", np.eye(4), fit=fit)


def test_an_accepted_calibration_is_believed_and_can_be_taken_back(state):
    misplaced = Misplace(True).apply(state)
    assert is_misplaced(misplaced) and not is_misplaced(Undo().apply(misplaced)) and not is_misplaced(Misplace(False).apply(misplaced))
    truth = really_at(misplaced.session)
    accepted = AcceptCalibration().apply(calibration_done(misplaced, found_at(truth)))
    np.testing.assert_allclose(accepted.session.workcell.finder.T_world_range, truth, atol=1e-12)
    np.testing.assert_allclose(really_at(accepted.session), truth, atol=1e-12)
    assert accepted.calibration is None and not is_misplaced(accepted)
    back = Undo().apply(accepted)
    np.testing.assert_allclose(back.session.workcell.finder.T_world_range, state.session.workcell.finder.T_world_range)
    np.testing.assert_allclose(really_at(back.session), truth, atol=1e-12)


def test_residuals_are_bars_and_outliers_are_hollow(state):
    found = found_at(from_xyz_rpy((0.28, -0.2, 0.0)))
    picture = residuals_svg(found.fit)
    assert picture.count("<rect") == 3 and picture.count('fill="none"') == 1 and "0.80 left out" in picture
    widths = [float(width) for width in re.findall(r'<rect [^>]*width="([\d.]+)"', picture)]
    np.testing.assert_allclose(np.array(widths) / widths[0], (1.0, 2.0, 8.0), rtol=0.02)
    assert "mind this" in found_html(found)
    failed = RangeCalibration("failed", "put the cube between the fingers", np.eye(4))
    assert calibration_done(state, failed).notices[-1].kind == "bad" and "put the cube" in found_html(failed)


# out


def gently(step):
    """The same step from rest to rest in 8 s, a sample each 10 ms, the hand never open beyond its limit."""
    time_s = np.linspace(0.0, 8.0, 801)
    share = (time_s / 8.0) ** 3 * (10.0 - 15.0 * time_s / 8.0 + 6.0 * (time_s / 8.0) ** 2)
    q = step.q_rad[0] + share[:, None] * (step.q_rad[-1] - step.q_rad[0])
    opening = np.minimum(step.hand_opening_m[0] + share * (step.hand_opening_m[-1] - step.hand_opening_m[0]), 0.08)
    return replace(step, time_s=time_s, q_rad=q, hand_opening_m=opening, clearance_m=np.full(801, 0.02))


@pytest.mark.parametrize("form", FORMS)
def test_the_plan_that_is_looked_at_is_written_for_controllers(tmp_path, form):
    state = opened(library(tmp_path), full_session(tmp_path), None)
    planned = state.session.results[0]
    steps = tuple(gently(step) for step in planned.plan.steps)
    slow = replace(planned, plan=replace(planned.plan, steps=steps), status="failed", reason="that does not matter")
    text = exported(replace(state, session=replace(state.session, results=(slow,))), form)
    assert len(text) > 1000 and (form != "csv" or len(read_csv(text).steps) == 5)


def test_the_dry_check_says_why_a_plan_is_not_written(tmp_path):
    with pytest.raises(BadInput, match="opens the hand by 100"):
        exported(opened(library(tmp_path), full_session(tmp_path), None), "csv")
    with pytest.raises(BadInput, match="no plan to export"):
        exported(opened(library(tmp_path), fresh_session(tmp_path), None), "csv")


# the working copy


def test_what_is_not_saved_is_kept_offered_and_taken_up_again(tmp_path, monkeypatch):
    monkeypatch.setattr(autosave, "AFTER_S", 0.05)
    state = SetSeed(42).apply(opened(library(tmp_path), fresh_session(tmp_path), None))
    keeper, copy = Autosave(state.library), own_copy(state.library)
    keeper.follow(opened(library(tmp_path), fresh_session(tmp_path), None))
    assert not copy.exists(), "a session that was only opened is not worth it"
    keeper.follow(state)
    end = time.monotonic() + 20
    while not copy.exists():
        assert time.monotonic() < end
        time.sleep(0.02)
    assert left_behind(state.library) is None, "this process still runs"
    gone = copy.with_name("999999999.handey")
    copy.rename(gone)
    assert left_behind(state.library) == gone
    offered = Offer(gone).apply(opened(library(tmp_path), fresh_session(tmp_path), None))
    taken = TakeUp().run(Bench(offered))
    assert taken.session.seed == 42 and taken.unsaved and taken.left_behind is None and copy.exists()
    keeper.follow(taken)
    keeper.follow(replace(taken, saved=taken.session))
    assert not copy.exists(), "what is saved needs no copy"
    write_session(gone, state.session)
    assert LetGo().apply(offered).left_behind is None and not gone.exists()


def test_a_copy_that_waits_is_written_when_the_workbench_ends(tmp_path):
    state = SetSeed(43).apply(opened(library(tmp_path), fresh_session(tmp_path), None))
    keeper = Autosave(state.library)
    keeper.follow(state)
    keeper.stop()
    assert own_copy(state.library).exists()
    assert with_view(state, time_s=1.0).unsaved and Seek(0.0).apply(state).unsaved


def test_a_click_on_an_incident_opens_its_entry_in_the_ledger(done):
    result = done.session.results[0]
    first = result.attempts[0]
    entry = next(entry for entry in result.ledger if entry.parent is not None)
    incident = replace(first.performance.incidents[0], entry=entry.id)
    attempt = replace(first, performance=replace(first.performance, incidents=(incident,)))
    state = with_result(done, replace(result, attempts=(attempt,)))
    state = LookAtHappening(0).apply(FilterLedger(words="nothing has this").apply(state))
    assert state.entry == entry and entry in ledger_page(state)
    assert LookAtHappening(1).apply(done).entry is None, "a decision has no entry of its own"


def test_an_earlier_attempt_is_looked_at_on_its_own_scan(done):
    result, scene = done.session.results[0], done.session.scene
    then = replace(scene.depth_map, elevation=scene.depth_map.elevation + 0.01)
    attempt = replace(result.attempts[0], scan=then, located=scene.instances[:1])
    state = with_result(done, replace(result, attempts=(attempt,)))
    before = LookAtAttempt(0).apply(state)
    shown = looking_back(before).session.scene
    assert shown.depth_map == then and shown.instances == scene.instances[:1] and not shown.located.edges
    assert looking_back(Seek(1.0).apply(before)).session.scene is shown, "it is made once, not each frame"
    assert looking_back(LookAtAttempt(1).apply(state)).session.scene is scene


def with_result(state, result):
    return replace(state, session=replace(state.session, results=(result,)))


def test_moves_before_and_after_a_calibration_stand_side_by_side(done):
    result, session = done.session.results[0], done.session
    goal = result.plan.T_world_part_goal
    part = session.workcell.parts[0]
    really = TrueBody("it", from_xyz_rpy((0.003, 0.0, 0.004)) @ goal, part=part)
    state = replace(done, session=replace(session, cell_now=replace(session.workcell.setup, bodies=(really,))))
    state = with_outcome(state)
    said = off_words(state.outcomes[0].truly_off)
    assert (state.outcomes[0].status, state.outcomes[0].attempts) == ("done", 2) and said == "5.0 mm 0.0°"
    state = with_outcome(Misplace(True).apply(state))
    assert len(state.outcomes) == 1 and not state.outcomes[0].misplaced, "what was found before went"
    shown = outcomes_html((*state.outcomes, replace(state.outcomes[0], misplaced=True, status="failed", reason="<b>slipped</b>")))
    assert shown.index("misplaced") < shown.index("in place") and "&lt;b&gt;slipped" in shown and "0.4 mm 0.1°" in shown


def test_what_goes_when_the_range_finder_is_moved_is_said(done, state):
    assert "went with it" in Misplace(True).apply(done).notices[-1].text
    assert "went with it" not in Misplace(True).apply(state).notices[-1].text


def test_which_motion_a_number_means_is_told_from_the_plan(done):
    plan = done.attempt.plan
    told = {call: which_words(plan, call).split(": ")[1] for call in ("grip", "follow", "descend")}
    assert "close" in told["grip"] and "transfer" in told["follow"] and "close" not in told["follow"]
    names = {name for words in told.values() for name in re.findall(r"\d+ (\w+)", words)}
    assert names == {step.kind for step in plan.steps} and "4 transfer" in which_words(None, "follow")


def test_the_result_comes_to_the_front_when_a_move_was_carried_out(done, state):
    working = JobStarted(True).apply(state)
    assert tabs_with_news(working, done) == ("Result",)
    assert tabs_with_news(done, TogglePlay().apply(done)) == () and tabs_with_news(state, working) == ()
    modelling = replace(state, model=replace(state.model, open=True))
    assert tabs_with_news(state, modelling) == ("Model", "Part") and tabs_with_news(modelling, state) == ("Move", "Result")
