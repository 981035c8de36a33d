"""A recorded cell plays what was kept, and says that it cannot act."""

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.cell.protocol import CannotAct, Cell
from handey_studio.cell.recorded import RecordedCell, read_depth_map, write_depth_map
from handey_studio.geometry.transforms import transform
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
    cell: Cell = RecordedCell.from_file(robot, path)
    assert cell.scan() == depth_map
    assert np.array_equal(cell.joints(), robot.home) and cell.opening() == robot.hand.opening_max and not cell.finger_force()
    motion = Trajectory(np.zeros(1), robot.home[None], np.zeros(1))
    for act in (lambda: cell.follow(motion), lambda: cell.descend(motion), lambda: cell.settle(), lambda: cell.grip(0.0)):
        with pytest.raises(CannotAct, match="recorded depth map"):
            act()


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
