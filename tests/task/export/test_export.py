"""What is written for a controller reads back as the plan; what the robot cannot do, or what is no name, is never written."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio import cli
from handey_studio.base import BadInput
from handey_studio.task.export import (
    GUARDED_SHARE,
    Program,
    at_rate,
    check_program,
    csv_text,
    program_from_move,
    read_csv,
    read_program,
    read_ros2,
    read_urscript,
    ros2_json,
    ros2_yaml,
    urscript,
)
from handey_studio.task.export.resampling import rates_of
from handey_studio.world import arm_of
from tests.task.export.plans import as_bytes, move_json, ur5


@pytest.fixture(scope="module")
def content():
    return move_json()


@pytest.fixture(scope="module")
def program(content):
    return program_from_move(as_bytes(content))


def assert_same(one: Program, other: Program, time: float = 0.0, angle: float = 0.0):
    assert (one.robot, one.joint_names) == (other.robot, other.joint_names)
    assert [step.kind for step in one.steps] == [step.kind for step in other.steps]
    for a, b in zip(one.steps, other.steps, strict=True):
        np.testing.assert_allclose(a.time_s, b.time_s, rtol=0, atol=time)
        np.testing.assert_allclose(a.q_rad, b.q_rad, rtol=0, atol=angle)
        np.testing.assert_allclose(a.opening_m, b.opening_m, rtol=0, atol=angle)


def test_the_program_is_the_plan(content, program):
    check_program(program, ur5())
    steps = content["moves"][0]["steps"]
    assert [step.q_rad.tolist() for step in program.steps] == [step["q_rad"] for step in steps]


def test_a_table_reads_back_as_the_very_same_numbers(program):
    assert_same(read_csv(csv_text(program)), program)
    times = [float(line.split(",")[2]) for line in csv_text(program).splitlines()[2:]]
    assert times == sorted(times) and times[-1] == pytest.approx(program.duration)


@pytest.mark.parametrize("write", [ros2_json, ros2_yaml])
def test_ros2_reads_back_to_the_nanosecond(program, write):
    assert_same(read_ros2(write(program, ur5())), program, time=5.1e-10)


def test_ros2_messages_have_the_fields_that_ros_asks_for(program):
    content = json.loads(ros2_json(program, ur5()))
    assert content == yaml.safe_load(ros2_yaml(program, ur5()))
    for step, plan in zip(content["steps"], program.steps, strict=True):
        if not plan.moves_arm:
            assert set(step["gripper_command"]["command"]) == {"position", "max_effort"}
            continue
        trajectory = step["joint_trajectory"]
        assert set(trajectory) == {"header", "joint_names", "points"} and trajectory["joint_names"] == list(program.joint_names)
        assert set(trajectory["header"]) == {"stamp", "frame_id"}
        stamps = [point["time_from_start"] for point in trajectory["points"]]
        assert all(0 <= stamp["nanosec"] < 1_000_000_000 for stamp in stamps)
        assert step["guarded"] == (plan.kind == "place")


@pytest.mark.parametrize("rate", [125.0, 500.0])
def test_urscript_reads_back_to_nine_decimals(program, rate):
    ticks = at_rate(program, rate, GUARDED_SHARE)
    check_program(ticks, ur5())
    text = urscript(ticks, ur5(), rate)
    assert_same(read_urscript(text), ticks, time=1e-9, angle=5.1e-10)


def test_urscript_stands_on_its_own_feet(program):
    """Every block is closed, everything that is called is defined or the controller's own, and contact is asked for in descents only."""
    text = urscript(at_rate(program, 125.0, GUARDED_SHARE), ur5(), 125.0)
    code = [line.split("#")[0].strip() for line in text.splitlines()]
    assert sum(line.endswith(":") for line in code) == code.count("end")
    own = set(re.findall(r"def (\w+)\(", text))
    controller = {"textmsg", "sleep", "get_tcp_force", "stopj", "popup", "get_actual_joint_positions", "norm", "servoj", "movej", "sqrt"}
    assert set(re.findall(r"(\w+)\(", "\n".join(code))) <= own | controller
    place = text.split(" place ")[1].split("# step")[0]
    assert "handey_go" not in place and place.count("handey_down") > 100 and "handey_landed(" in place
    assert text.count("handey_down([") == place.count("handey_down([")
    after = text.split(" retreat ")[1]
    assert "handey_lead(" in after and "handey_begin(" not in after, "after a descent the arm may stand a little off"


def test_contact_is_too_early_more_than_4_mm_above_the_end(program):
    ticks = at_rate(program, 125.0, GUARDED_SHARE)
    text = urscript(ticks, ur5(), 125.0)
    least = int(re.search(r"handey_landed\((\d+)\)", text)[1])
    place = next(step for step in ticks.steps if step.kind == "place")
    heights = arm_of(ur5()).hand_pose(place.q_rad)[:, 2, 3] - arm_of(ur5()).hand_pose(place.q_rad[-1])[2, 3]
    assert heights[least] <= 0.004 < heights[least - 1]


@settings(max_examples=25, deadline=None)
@given(rate=st.floats(60.0, 1000.0), share=st.floats(0.05, 1.0), seed=st.integers(0, 3))
def test_ticks_stay_within_the_limits_and_on_the_way(rate, share, seed):
    program = program_from_move(as_bytes(move_json(seed=seed)))
    ticks = at_rate(program, rate, share)
    check_program(ticks, ur5())
    for plan, step in zip(program.steps, ticks.steps, strict=True):
        assert np.array_equal(step.q_rad[[0, -1]], plan.q_rad[[0, -1]])
        slower = 1 / share if step.kind == "place" else 1.0
        assert -1e-9 <= step.time_s[-1] - plan.time_s[-1] * (slower if plan.moves_arm else 1.0) <= 1 / rate + 1e-9
        along = step.time_s / step.time_s[-1] * plan.time_s[-1]
        straight = np.stack([np.interp(along, plan.time_s, joint) for joint in plan.q_rad.T], axis=1)
        assert np.abs(straight - step.q_rad).max() < 5e-4


def test_velocities_are_the_motions_own(program):
    step = next(step for step in program.steps if step.moves_arm)
    velocity, acceleration = rates_of(step)
    np.testing.assert_allclose(velocity[[0, -1]], 0.0, atol=1e-9)
    np.testing.assert_allclose(
        velocity[1:-1], (step.q_rad[2:] - step.q_rad[:-2]) / (step.time_s[2:] - step.time_s[:-2])[:, None], atol=2e-2
    )
    assert np.abs(velocity).max(axis=0).max() <= ur5().velocity.max() * 1.01 and acceleration.shape == velocity.shape


def faulty(content, change):
    content = json.loads(json.dumps(content))
    change(content["moves"][0]["steps"], content)
    return content


def shift(key, at, value):
    def change(steps, _):
        steps[1][key][at] = (np.array(steps[1][key][at]) + value).tolist()

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (shift("q_rad", 20, [0, 0, 4.0, 0, 0, 0]), r"step 2 \(free\) takes elbow_joint to .*its limits are -180.0 to 180.0°"),
        (shift("q_rad", 20, [0, 0, 0, 0.05, 0, 0]), r"step 2 \(free\) turns wrist_1_joint by .*its limit is 120.0 °/s"),
        (shift("q_rad", 20, [0, 0, 0, 0.003, 0, 0]), r"step 2 \(free\) accelerates wrist_1_joint by .*its limit is 360.0 °/s²"),
        (lambda steps, _: [steps[1][key].__delitem__(slice(10, 15)) for key in ("time_s", "q_rad", "hand_opening_m")], "has a gap of 4"),
        (lambda steps, _: steps.pop(2), "jumps by .* from step 2"),
        (lambda steps, _: steps[0]["hand_opening_m"].__setitem__(1, 0.2), "opens the hand by 9.* to 200.0 mm"),
        (lambda steps, _: steps[1]["hand_opening_m"].__setitem__(-1, 0.02), "moves the joints and the fingers at once"),
        (lambda steps, _: steps[0]["hand_opening_m"].__setitem__(1, 0.05), "the hand jumps by 10.00 mm"),
    ],
)
def test_the_dry_check_tells_joint_value_and_limit(content, change, words):
    with pytest.raises(BadInput, match=words):
        check_program(program_from_move(as_bytes(faulty(content, change))), ur5())


@pytest.mark.parametrize("name", ["elbow\nhalt", "a);halt(", "", "1st", "elbow joint", "é" * 3, "x" * 65, '"', "a,b"])
def test_names_that_are_no_identifiers_never_get_into_a_program(content, name):
    def rename(steps, _):
        for step in steps:
            step["joint_names"][2] = name

    with pytest.raises(BadInput, match="no identifier"):
        program_from_move(as_bytes(faulty(content, rename)))
    with pytest.raises(BadInput, match="no identifier"):
        program_from_move(as_bytes(content | {"robot": name}))


def test_nothing_of_the_file_but_names_and_numbers_is_written(content, program):
    """Parts, reasons and destinations are free text: they stay out."""
    evil = "brick\n  halt\nend\n"
    told = faulty(content, lambda steps, c: (c["moves"][0].update(part=evil, reason=evil, destination=evil), steps[1].update(held=evil)))
    again = program_from_move(as_bytes(told))
    ticks = at_rate(program, 125.0)
    assert urscript(at_rate(again, 125.0), ur5(), 125.0) == urscript(ticks, ur5(), 125.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda steps, c: c.update(schema="handey/move/9"), 'must be "handey/move/1"'),
        (lambda steps, c: c["moves"][0].update(status="failed"), "none of its 1 MOVEs has a plan"),
        (lambda steps, c: steps[1].update(kind="halt"), "Invalid enum value 'halt'"),
        (lambda steps, c: steps[1]["q_rad"].pop(), "needs 6 angles and one opening for each"),
        (lambda steps, c: steps[1]["q_rad"][3].append(0.0), "needs 6 angles"),
        (lambda steps, c: steps[1]["time_s"].__setitem__(4, 0.0), "times that do not rise"),
        (lambda steps, c: steps[1]["joint_names"].reverse(), "must be the same"),
        (lambda steps, c: steps[1].update(time_s="now"), "Expected `array`"),
    ],
)
def test_files_that_are_no_plans_are_refused(content, change, words):
    with pytest.raises(BadInput, match=re.escape(words)):
        program_from_move(as_bytes(faulty(content, change)))


@given(st.binary(max_size=300))
def test_any_bytes_are_refused_in_a_sentence(data):
    with pytest.raises(BadInput):
        program_from_move(data)


@given(st.text(max_size=200))
def test_any_text_is_refused_by_the_readers(text):
    for read in (read_csv, read_urscript, read_ros2):
        with pytest.raises(BadInput):
            read(text)


def test_other_arms_get_no_urscript(program):
    with pytest.raises(BadInput, match="Universal Robots arms"):
        urscript(at_rate(program, 125.0), replace(ur5(), name="puma", ik="spherical_wrist"), 125.0)
    with pytest.raises(BadInput, match="125 or 500 Hz, not at 100"):
        urscript(program, ur5(), 100.0)
    with pytest.raises(BadInput, match="is for the joints"):
        check_program(program, replace(ur5(), joint_names=tuple("abcdef")))


@pytest.mark.parametrize(("form", "name"), [("urscript", "move.script"), ("ros2", "move.ros2.json"), ("csv", "move.csv")])
def test_the_shell_writes_beside_the_plan(tmp_path, capsys, content, form, name):
    (tmp_path / "move.json").write_bytes(as_bytes(content))
    assert cli.main(["export", str(tmp_path / "move.json"), "--format", form]) == 0
    read = {"urscript": read_urscript, "ros2": read_ros2, "csv": read_csv}[form]
    assert len(read((tmp_path / name).read_text()).steps) == len(content["moves"][0]["steps"])
    assert "within the limits of ur5" in capsys.readouterr().out


def test_the_shell_writes_yaml_and_refuses_without_a_trace(tmp_path, capsys, content):
    path = tmp_path / "move.json"
    path.write_bytes(as_bytes(content))
    assert cli.main(["export", str(path), "--format", "ros2", "--out", str(tmp_path / "m.yaml")]) == 0
    assert_same(read_ros2((tmp_path / "m.yaml").read_text()), read_program(path), time=5.1e-10)
    path.write_bytes(as_bytes(faulty(content, shift("q_rad", 20, [0, 0, 0, 0.05, 0, 0]))))
    assert cli.main(["export", str(path), "--format", "csv"]) == 2
    assert capsys.readouterr().err.count("\n") == 1 and not (tmp_path / "move.csv").exists()
    assert cli.main(["export", str(tmp_path / "none.json"), "--format", "csv"]) == 2
