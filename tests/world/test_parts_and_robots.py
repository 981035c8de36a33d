import pickle

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.geometry import box
from handey_studio.world import Library, arm_of, load_robot, read_part, write_obj


@pytest.fixture(scope="module")
def robot():
    return Library.choose().robot("ur5")


def test_ik_finds_every_hidden_configuration(robot):
    arm, rng = arm_of(robot), np.random.default_rng(1)
    for q in rng.uniform(-3.1, 3.1, (100, 6)):
        T = arm.hand_pose(q)
        branches = arm.ik(T)
        assert np.abs(arm.hand_pose(branches) - T).max() < 1e-8
        turned = np.abs(np.mod(branches - q + np.pi, 2 * np.pi) - np.pi).max(axis=1)
        assert turned.min() < 1e-6


def test_ik_says_out_of_reach_with_no_branch(robot):
    T = np.eye(4)
    T[:3, 3] = (3.0, 0.0, 0.0)
    assert arm_of(robot).ik(T).shape == (0, 6)


def test_forward_kinematics_agrees_with_pinocchio(robot):
    import pinocchio

    arm = arm_of(robot)
    data = arm.model.createData()
    for q in np.random.default_rng(2).uniform(-6, 6, (20, 6)):
        pinocchio.forwardKinematics(arm.model, data, q)
        for i in range(1, 7):
            assert np.allclose(robot.T_world_base @ data.oMi[i].homogeneous, arm.link_poses(q)[i], atol=1e-10)


def test_nearest_turns_stay_within_the_limits(robot):
    arm = arm_of(robot)
    near = np.array([6.0, -6.0, 0.0, 5.0, 0.0, -6.2])
    q = arm.nearest_turns(np.array([-0.5, 0.5, 3.0, -1.5, 0.1, 0.2]), near)
    assert (robot.limit_margin(q) >= 0).all() and np.allclose(np.cos(q), np.cos([-0.5, 0.5, 3.0, -1.5, 0.1, 0.2]))
    assert np.abs(q - near)[[0, 1, 3, 5]].max() < np.pi


def test_a_robot_crosses_process_borders_unchanged(robot):
    again = pickle.loads(pickle.dumps(robot))
    assert again == robot and hash(again) == hash(robot) and arm_of(again) is arm_of(robot)


@pytest.mark.parametrize("name", sorted(Library.choose().part_files()))
def test_every_part_round_trips_through_obj(name, tmp_path):
    part = Library.choose().part(name)
    write_obj(tmp_path / "copy.obj", part.solid)
    again = read_part(tmp_path / "copy.obj")
    assert np.isclose(again.solid.volume_and_centroid[0], part.solid.volume_and_centroid[0])
    assert len(again.solid.faces) == len(part.solid.faces) and len(again.solid.edges) == len(part.solid.edges)


def test_the_mated_l_blocks_form_a_block():
    part = Library.choose().part("l_block")
    mate = part.mates["block"]
    corners = np.concatenate([part.solid.vertices, part.solid.vertices @ mate.T_this_part[:3, :3].T + mate.T_this_part[:3, 3]])
    size = np.ptp(corners, axis=0)
    assert np.allclose(size, (0.060, 0.0995, 0.040))
    play = 1 - 2 * part.solid.volume_and_centroid[0] / np.prod(size)
    assert np.isclose(play * size[0] * size[1], 0.001 * 0.0405, rtol=0.01)


def test_unknown_names_list_the_choices():
    with pytest.raises(BadInput, match=r'robot "foo" is not known; choose one of: .*ur5'):
        Library.choose().robot("foo")
    with pytest.raises(BadInput, match=r'part "foo" is not known; choose one of: .*l_block'):
        Library.choose().part("foo")


def test_millimetre_files_are_recognised(tmp_path):
    write_obj(tmp_path / "mm.obj", box((60.0, 50.0, 40.0)))
    with pytest.raises(BadInput, match=r"scale of 0\.001"):
        read_part(tmp_path / "mm.obj")
    assert np.isclose(read_part(tmp_path / "mm.obj", 0.001).solid.diameter, 0.0877, atol=1e-3)


def test_rubbish_is_refused_in_one_sentence(tmp_path):
    (tmp_path / "bad.obj").write_text("v 0 0 zero\nf 1 2 3\n")
    with pytest.raises(BadInput, match="line 1"):
        read_part(tmp_path / "bad.obj")
    (tmp_path / "bad.stl").write_bytes(b"\x00" * 90)
    with pytest.raises(BadInput):
        read_part(tmp_path / "bad.stl")


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('ik = "ur"', "", "lacks the key 'ik'"),
        ("home_deg = [-90, -110", "home_deg = [999, -110", "home_deg lies outside"),
        ("velocity_deg_s = [90, 90, 90, 120, 120, 120]", "velocity_deg_s = [90]", "must list 6 finite numbers"),
        ("name =", "name = =", "cannot be read as TOML"),
    ],
)
def test_a_broken_robot_folder_is_told_in_a_sentence(tmp_path, old, new, says):
    from handey_studio.world.library import bundled

    text = (bundled() / "robots" / "ur5" / "robot.toml").read_text()
    assert old in text
    (tmp_path / "robot.toml").write_text(text.replace(old, new))
    with pytest.raises(BadInput, match=says):
        load_robot(tmp_path)
