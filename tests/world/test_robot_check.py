"""A robot folder is told what is wrong with it, and the bundled ones have nothing wrong."""

import re
import shutil

import pytest

from handey_studio.cli import main
from handey_studio.world import Library
from handey_studio.world.library import bundled
from handey_studio.world.robot_check import check_robot

FOLDER = bundled() / "robots" / "puma560"


@pytest.fixture
def folder(tmp_path):
    """A copy of the Puma to break."""
    return shutil.copytree(FOLDER, tmp_path / "mine")


def changed(folder, file, old, new):
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    return check_robot(folder)


@pytest.mark.parametrize("name", sorted(Library.choose().robot_folders()))
def test_the_bundled_robots_have_nothing_wrong(name):
    report = check_robot(bundled() / "robots" / name)
    assert report.wrong == ()
    assert any("postures again from their poses" in sentence for sentence in report.right)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('flange = "flange"', "", "lacks the key 'flange'"),
        ("force_N = 40", 'force_N = "much"', "has hand.force_N = much; it must be a finite number"),
        ("[-75, 45,", "[-75, true,", "has home_deg = "),
        ("velocity_deg_s = [82,", "velocity_deg_s = [", "has 5 numbers in limits.velocity_deg_s; it must list 6"),
        ('arm_joints = ["waist", ', "arm_joints = [", "it takes exactly 3"),
        ('"flange_roll"]', '"flange_rol"]', r"names joints \['flange_rol'\] that its URDF lacks; it has \["),
        ('flange = "flange"', 'flange = "tool"', 'no frame "tool"'),
        ('urdf = "puma560.urdf"', 'urdf = "puma.urdf"', "does not exist"),
        ("home_deg = [-75,", "home_deg = [-175,", "home_deg lies outside the joint limits: waist at -175°"),
        ("home_deg = [-75, 45, -195, 0, -30, 0]", "home_deg = [20, -40, -170, 20, 0, -200]", "at home_deg .* overlap by"),
        ("upper_deg = [160,", "upper_deg = [200,", r"limits.upper_deg of waist is 200°, beyond the URDF's 160.0°"),
        ("opening_max_m = 0.090", "opening_max_m = 0.190", "opening_max_m must not be more than crosspiece_length_m"),
        ("min_contact_area_mm2 = 120", "min_contact_area_mm2 = 12000", "more than the finger's whole face"),
        ('ik = "spherical_wrist"', 'ik = "ur"', "needs axes 3 and 4 parallel"),
        ('ik = "spherical_wrist"', 'ik = "spherical"', "choose one of"),
        ("[base]", 'ignored_bodies = ["flange_0"]\n\n[base]', r"ignored_bodies names \['flange_0'\], which the URDF lacks"),
        ("[base]", "[held_joints]\nflange_roll = [0]\n\n[base]", "lacks the key 'joints'"),
    ],
)
def test_each_fault_is_told_in_a_sentence(folder, old, new, says):
    report = changed(folder, "robot.toml", old, new)
    assert len(report.wrong) == 1 and report.wrong[0].endswith(".")
    assert re.search(says, report.wrong[0])


def test_faults_of_the_table_are_told_all_at_once(folder):
    report = changed(folder, "robot.toml", 'ik = "spherical_wrist"\nflange = "flange"', 'flanges = "flange"')
    assert len(report.wrong) == 2 and "'ik'" in report.wrong[0] and "'flange'" in report.wrong[1]
    assert 'the key "flanges"' in report.notes[0]


def test_a_urdf_that_is_none_and_a_folder_without_a_robot(folder, tmp_path):
    (folder / "puma560.urdf").write_text("<robot")
    assert "does not load" in check_robot(folder).wrong[0]
    assert "has no robot.toml" in check_robot(tmp_path).wrong[0]


def test_a_link_without_a_body_is_told(folder):
    shape = '<collision><origin xyz="0.19 0 0.2375"/><geometry><box size="0.60 0.19 0.085"/></geometry></collision>'
    assert "the link that shoulder moves has no collision body" in changed(folder, "puma560.urdf", shape, "").wrong[0]


def test_pairs_that_always_touch_are_told(folder):
    report = changed(folder, "puma560.urdf", '<cylinder radius="0.036" length="0.07"/>', '<cylinder radius="0.1" length="0.07"/>')
    assert any("touch at every posture" in note and "forearm and knuckle" in note for note in report.notes)


def test_the_command_exits_with_2_where_something_is_wrong(folder, capsys):
    assert main(["robot", "check", str(folder)]) == 0
    assert "nothing wrong" in capsys.readouterr().out
    changed(folder, "robot.toml", "force_N = 40", "force_N = -1")
    assert main(["robot", "check", str(folder)]) == 2
    assert "wrong: robot.toml: hand.force_N" in capsys.readouterr().out


def test_the_library_s_robots_are_listed(capsys):
    assert main(["robot", "list"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in ("panda", "puma560", "ur10", "ur3", "ur5", "xarm7"))
