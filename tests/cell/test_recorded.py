"""A recorded cell plays what was kept, and says that it cannot act."""

import json
from dataclasses import replace

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.cell.protocol import CannotAct, Cell
from handey_studio.cell.recorded import RecordedCell, read_depth_map, write_depth_map
from handey_studio.geometry.transforms import from_xyz_rpy, transform
from handey_studio.motion import Trajectory
from handey_studio.sensing.depth_map import DepthMap


@pytest.fixture
def kept(tmp_path):
    elevation = np.random.default_rng(0).uniform(0, 0.1, (20, 30))
    elevation[3:5, 7:9] = np.nan
    passed = np.nan_to_num(elevation, nan=0.04)
    depth_map = DepthMap(elevation, 0.002, transform(None, (0.4, -0.1, 0)), passed, 3e-4, 2e-3)
    path = tmp_path / "scan.npz"
    write_depth_map(path, depth_map)
    return path, depth_map


def test_a_depth_map_comes_back_as_it_was(kept):
    path, depth_map = kept
    assert read_depth_map(path) == depth_map


def test_it_scans_and_refuses_to_act(kept, robot):
    path, depth_map = kept
    cell: Cell = RecordedCell.from_files(robot, [path])
    assert cell.scan() == depth_map
    assert np.array_equal(cell.joints(), robot.home) and cell.opening() == robot.hand.opening_max and not cell.finger_force()
    motion = Trajectory(np.zeros(1), robot.home[None], np.zeros(1))
    for act in (lambda: cell.follow(motion), lambda: cell.descend(motion), lambda: cell.settle(), lambda: cell.grip(0.0)):
        with pytest.raises(CannotAct, match="recorded depth"):
            act()


def test_it_plays_one_scan_after_the_other(kept, robot):
    _, first = kept
    second = replace(first, elevation=first.elevation + 0.01)
    cell = RecordedCell(robot, [first, second])
    assert [cell.scan() for _ in range(3)] == [first, second, second]
    with pytest.raises(BadInput, match="at least one"):
        RecordedCell(robot, [])


def test_depth_of_a_camera_becomes_a_depth_map_on_its_support(robot, tmp_path):
    """A camera looks askew at a table with a block on it; its cloud tells nothing about where it stands."""
    T_world_sensor = transform(None, (0.0, 0.0, 0.8)) @ from_xyz_rpy((0.0, 0.0, 0.0), (np.pi - 0.3, 0.0, 0.0))
    v, u = np.mgrid[:120, :160]
    rays = np.stack([(u - 80) / 160, (v - 60) / 160, np.ones(u.shape)], axis=-1)
    down = (T_world_sensor[:3, :3] @ rays.reshape(-1, 3).T).T.reshape(rays.shape)[..., 2]
    heights = np.where((abs(u - 80) < 20) & (abs(v - 60) < 15), 0.04, 0.0)
    np.save(tmp_path / "cloud.npy", rays * ((heights - 0.8) / down)[..., None])
    seen = RecordedCell.from_files(robot, [tmp_path / "cloud.npy"]).scan()
    assert np.nanmedian(seen.elevation) == pytest.approx(0.0, abs=1e-3) and np.nanmax(seen.elevation) == pytest.approx(0.04, abs=2e-3)


def test_with_a_folder_it_writes_the_motions_and_stands_where_they_end(kept, robot, tmp_path):
    _, depth_map = kept
    cell = RecordedCell(robot, [depth_map], tmp_path / "out")
    motion = Trajectory(np.array([0.0, 1.0]), np.array([robot.home, robot.home + 0.2]), np.array([0.09, 0.05]))
    assert cell.follow(motion).ended == "arrived" and cell.grip(0.03, 12.0).opening_m == 0.03
    assert not cell.descend(Trajectory(motion.time_s, motion.q_rad[::-1], np.full(2, 0.03)), 4.0).contact and not cell.settle().contact
    assert np.allclose(cell.joints(), robot.home) and cell.opening() == 0.03
    written = [json.loads(path.read_text()) for path in sorted((tmp_path / "out").iterdir())]
    assert [one["call"] for one in written] == ["follow", "grip", "descend", "settle"]
    assert all(one["schema"] == "handey/motion/1" and one["robot"] == "ur5" for one in written)
    assert np.array_equal(written[0]["q_rad"], motion.q_rad) and written[1]["force_N"] == 12.0 and written[2]["until_N"] == 4.0
    with pytest.raises(CannotAct, match="starts"):
        cell.follow(replace(motion, q_rad=motion.q_rad + 0.1))


def test_what_is_not_a_depth_map_is_refused_in_a_sentence(kept, tmp_path):
    path, _ = kept
    arrays = dict(np.load(path))
    (tmp_path / "text.npz").write_text("not a zip")
    (tmp_path / "cut.npz").write_bytes(path.read_bytes()[:200])
    np.savez(tmp_path / "lacks.npz", elevation=arrays["elevation"])
    np.savez(tmp_path / "empty.npz", **(arrays | {"elevation": np.full((20, 30), np.nan)}))
    np.savez(tmp_path / "bent.npz", **(arrays | {"T_world_range": np.zeros((4, 4))}))
    np.savez(tmp_path / "flat.npz", **(arrays | {"elevation": np.zeros(30), "passed": np.zeros(30)}))
    np.savez(tmp_path / "zero.npz", **(arrays | {"cell": 0.0}))
    np.savez(tmp_path / "pickle.npz", **(arrays | {"passed": np.array([{"a": 1}], dtype=object)}))
    names = ("text", "cut", "lacks", "empty", "bent", "flat", "zero", "pickle", "missing")
    for name in names:
        with pytest.raises(BadInput) as told:
            read_depth_map(tmp_path / f"{name}.npz")
        assert f"{name}.npz" in str(told.value) and "\n" not in str(told.value)
