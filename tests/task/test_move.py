"""Whole MOVEs in the simulated cell, judged by hands that share nothing with the planner."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from handey_studio.cell.check.checker import check_plan, names_in_plan
from handey_studio.cell.geometric import GeometricCell
from handey_studio.geometry.transforms import inverse, pose_difference
from handey_studio.localization import Rival
from handey_studio.session import find_session, read_session
from handey_studio.session.run import cell_of, station_of
from handey_studio.task import MoveCommand, MoveOptions, SearchOptions, execute_in, plan_in, sense
from handey_studio.world import Library

LIBRARY = Library.choose()


class Figure1:
    """The Figure 1 session sensed once; every test gets its own cell."""

    def __init__(self):
        self.session = read_session(find_session(LIBRARY, "figure1"))
        self.station = station_of(self.session, LIBRARY)
        self.cell = cell_of(self.session, LIBRARY)
        self.truth = self.cell.true_scene()
        self.scene = sense(self.station, self.cell, seed=1)

    def plan(self, to, part="l_block", seed=1):
        cell = self.cell
        return plan_in(self.station, self.scene, MoveCommand(part, to), cell.joints(), cell.opening(), MoveOptions(seed=seed))

    def true_name(self, located):
        names = names_in_plan(self.truth, {placed.name: placed.T_world_part for placed in self.scene.instances})
        return next(true for true, name in names.items() if name == located)


@pytest.fixture(scope="module")
def figure1():
    return Figure1()


@pytest.fixture(scope="module")
def planned(figure1):
    return figure1.plan("on:l_block:block")


def test_both_l_blocks_are_located_within_the_play(figure1):
    assert len(figure1.scene.instances) == 2
    for placed in figure1.scene.instances:
        metres, radians = pose_difference(placed.T_world_part, GeometricCell.true_pose(figure1.cell, figure1.true_name(placed.name)))
        assert metres < 0.001 and radians < np.deg2rad(0.5)


def test_the_plan_passes_the_independent_check(figure1, planned):
    assert planned.status == "planned", planned.reason
    located = {placed.name: placed.T_world_part for placed in figure1.scene.instances}
    report = check_plan(planned.plan.steps, figure1.truth, figure1.station.robot, names_in_plan(figure1.truth, located))
    assert report.configurations > 1000
    assert report.ok, report.violations
    assert planned.plan.certificate.proved


def test_the_checker_would_have_caught_a_plan_through_the_table(figure1, planned):
    """The same plan with its approach pushed on beyond the grasp must not pass."""
    steps = list(planned.plan.steps)
    k = next(k for k, step in enumerate(steps) if step.kind == "lift")
    lift = steps[k]
    down = lift.q_rad.copy()
    down[:, 1] += np.linspace(0.0, 0.4, len(down))
    steps[k] = replace(lift, q_rad=down)
    located = {placed.name: placed.T_world_part for placed in figure1.scene.instances}
    assert not check_plan(steps[: k + 1], figure1.truth, figure1.station.robot, names_in_plan(figure1.truth, located)).ok


def test_the_same_seed_gives_the_same_plan(figure1, planned):
    again = figure1.plan("on:l_block:block")
    assert [step.kind for step in again.plan.steps] == [step.kind for step in planned.plan.steps]
    assert all(np.array_equal(a.q_rad, b.q_rad) for a, b in zip(again.plan.steps, planned.plan.steps, strict=True))
    assert again.ledger == planned.ledger


def test_the_executed_move_makes_a_block(figure1, planned):
    cell = cell_of(figure1.session, LIBRARY)
    done = execute_in(figure1.station, figure1.scene, planned, cell)
    assert done.status == "done", done.reason
    assert done.physics is True
    moved = figure1.true_name(planned.plan.part)
    other = next(name for name in ("l_block#1", "l_block#2") if name != moved)
    mate = figure1.station.models["l_block"].mates["block"].T_this_part
    metres, radians = pose_difference(inverse(cell.true_pose(other)) @ cell.true_pose(moved), mate)
    assert metres < 0.002 and radians < np.deg2rad(1.0)
    metres, radians = pose_difference(done.T_world_part_reached, cell.true_pose(moved))
    assert metres < 0.002 and radians < np.deg2rad(1.0)


def test_every_fallen_option_says_why(planned):
    fallen = [entry for entry in planned.ledger if entry.reason]
    assert fallen
    for entry in fallen:
        assert entry.stage and entry.option
        assert entry.limit is None or entry.value is not None
    parents = {entry.id for entry in planned.ledger}
    assert all(entry.parent is None or (entry.parent in parents and entry.parent < entry.id) for entry in planned.ledger)


@pytest.mark.parametrize(
    ("to", "says"),
    [
        ("0.47,0.13,0.02,90,0,0", "the part would stand in something"),
        ("0.45,0.33,0.30,90,0,0", "nothing holds the part up"),
        ("0.45,0.33,-0.05,90,0,0", "the part would stand in something"),
        ("5,0,0,90,0,0", "outside the free space"),
        ("1.1,0.5,0.0,90,0,0", "none of"),
    ],
)
def test_impossible_destinations_are_told_with_the_number(figure1, to, says):
    result = figure1.plan(to)
    assert result.status == "failed" and result.plan is None
    assert says in result.reason
    assert any(entry.reason for entry in result.ledger)


def test_a_move_that_turns_the_part_over_puts_it_down_on_the_way(figure1):
    upright = min(figure1.scene.instances, key=lambda placed: abs(placed.T_world_part[2, 1] - 1))
    result = figure1.plan("0.45,0.33,0.07,-90,0,0", part=upright.name)
    assert result.status == "planned" and result.plan.regrasps == 1, result.reason
    located = {placed.name: placed.T_world_part for placed in figure1.scene.instances}
    report = check_plan(result.plan.steps, figure1.truth, figure1.station.robot, names_in_plan(figure1.truth, located))
    assert report.ok, report.violations
    first, second = result.plan.carries
    assert not np.allclose(first.grasp.T_hand_part, second.grasp.T_hand_part, atol=0.01)
    assert result.plan.steps[second.first_step].held is None
    cell = cell_of(figure1.session, LIBRARY)
    done = execute_in(figure1.station, figure1.scene, result, cell)
    assert done.status == "done", done.reason
    metres, radians = pose_difference(cell.true_pose(figure1.true_name(upright.name)), result.plan.T_world_part_goal)
    assert metres < 0.003 and radians < np.deg2rad(1.0)


def test_any_of_the_parts_goes_anywhere_in_an_area(figure1):
    result = figure1.plan("in:0.3,0.25,0.6,0.45")
    assert result.status == "planned", result.reason
    x, y = result.plan.T_world_part_goal[:2, 3]
    assert 0.2 < x < 0.7 and 0.15 < y < 0.55
    located = {placed.name: placed.T_world_part for placed in figure1.scene.instances}
    assert check_plan(result.plan.steps, figure1.truth, figure1.station.robot, names_in_plan(figure1.truth, located)).ok
    nowhere = figure1.plan("in:0.47,0.12,0.49,0.14")
    assert nowhere.status == "failed" and "no free place" in nowhere.reason


def test_a_part_that_could_as_well_lie_otherwise_is_not_moved(figure1):
    located = figure1.scene.located
    rivals = [(Rival(pose.part, pose.T_world_part, 0.97 * pose.score),) for pose in located.poses]
    poses = tuple(replace(pose, rivals=rival) for pose, rival in zip(located.poses, rivals, strict=True))
    scene = replace(figure1.scene, located=replace(located, poses=poses))
    cell = figure1.cell
    result = plan_in(figure1.station, scene, MoveCommand("l_block", "on:l_block:block"), cell.joints(), cell.opening())
    assert result.status == "failed" and "could nearly as well stand otherwise" in result.reason and "0.97" in result.reason


def test_a_limit_on_the_effort_is_in_the_ledger(figure1):
    cell = figure1.cell
    to = MoveCommand("l_block", "0.45,0.33,0,90,0,0")
    options = MoveOptions(search=SearchOptions(effort=0.001))
    result = plan_in(figure1.station, figure1.scene, to, cell.joints(), cell.opening(), options)
    (cut,) = [entry for entry in result.ledger if entry.stage == "options"]
    assert result.status == "failed" and cut.reason == "not looked at: the effort is spent"
    assert int(cut.option.split()[0]) > 100 and cut.value >= cut.limit == 0.001
    assert sum(entry.stage == "grasp group" for entry in result.ledger) == 1


def test_a_part_that_is_not_there_is_not_found(figure1):
    from handey_studio.task import Station

    station = Station(figure1.station.workcell, figure1.station.robot, (LIBRARY.part("stairs"),))
    scene = sense(station, cell_of(figure1.session, LIBRARY), seed=1)
    assert scene.instances == ()
    result = plan_in(station, scene, MoveCommand("stairs", "0.45,0.33,0"), station.robot.home, 0.09)
    assert result.status == "failed" and "was not found in the scan" in result.reason


def handey(*arguments, cwd=None):
    return subprocess.run([sys.executable, "-m", "handey_studio.cli", *arguments], capture_output=True, text=True, cwd=cwd, check=False)


def test_the_whole_move_from_the_shell(tmp_path):
    out, saved = tmp_path / "move.json", tmp_path / "after.handey"
    ran = handey("move", "figure1", "--json", str(out), "--save", str(saved))
    assert ran.returncode == 0, ran.stderr
    report = json.loads(out.read_text())
    assert report["schema"] == "handey/move/1" and report["robot"] == "ur5"
    (move,) = report["moves"]
    assert move["status"] == "done" and move["physics"] is True and move["certificate"]["proved"]
    assert np.abs(np.array(move["T_world_part_reached"]) - move["T_world_part_goal"]).max() < 0.02
    kinds = [step["kind"] for step in move["steps"]]
    assert kinds == ["free", "free", "approach", "close", "lift", "transfer", "place", "open", "retreat", "free"]
    for step in move["steps"]:
        assert len(step["time_s"]) == len(step["q_rad"]) == len(step["hand_opening_m"])
        assert step["time_s"][0] == 0 and (np.diff(step["time_s"]) >= 0).all()
        assert {"held", "T_hand_part", "allowed_contacts", "joint_names"} <= set(step)
    assert {"id", "parent", "stage", "option", "reason", "value", "limit", "unit", "bodies"} <= set(move["ledger"][0])
    session = read_session(saved)
    assert session.result is not None and session.result.status == "done"
    again = handey("plan", str(saved), "--part", "l_block", "--to", "0.45,0.33,0,90,0,0", cwd=tmp_path)
    assert again.returncode in (0, 1), again.stderr


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("move", "nothing"), "nothing"),
        (("move", "figure1", "--part", "l_block"), "--part and --to go together"),
        (("move", "figure1", "--part", "gear", "--to", "0,0,0"), 'part "gear" is not'),
        (("move", "figure1", "--part", "l_block", "--to", "here"), "is not understood"),
        (("locate", "--depth", "no.png", "--camera", "no.json", "--part", "brick", "--json", "x.json"), "no.json"),
        (("studio", "--port", "99999"), "not a port"),
        (("move", "figure1", "--json", "no/folder/out.json"), 'the folder "no/folder" does not exist'),
        (("fly",), "invalid choice"),
        (("bench", "moves", "--seeds", "a:b"), "FIRST:END"),
    ],
)
def test_bad_input_is_one_sentence_and_status_2(tmp_path, arguments, says):
    ran = handey(*arguments, cwd=tmp_path)
    assert ran.returncode == 2, (ran.returncode, ran.stdout, ran.stderr)
    assert says in ran.stderr and "Traceback" not in ran.stderr
    assert len(ran.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == [], "no file was written"
