"""`handey locate` given what nobody should give it: an answer or one sentence, whatever the file holds."""

import json
import resource
import sys

import cv2
import numpy as np
import pytest

from handey_studio import cli
from handey_studio.cell.recorded import read_depth_map
from handey_studio.geometry.transforms import transform
from handey_studio.sensing.depth_view import Pinhole
from tests.sensing.cloud_files import write_pcd, write_ply
from tests.sensing.scenes import cast, looking_at

CAMERA = {"fx": 400.0, "fy": 400.0, "cx": 159.5, "cy": 119.5, "depth_scale": 0.1}
PINHOLE = Pinhole(400.0, 400.0, 159.5, 119.5)
OBJ = "".join(f"v {x} {y} {z}\n" for x in (-0.04, 0.04) for y in (-0.03, 0.03) for z in (-0.02, 0.02))
OBJ += "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"


@pytest.fixture
def locate(tmp_path, capsys):
    """Runs `handey locate` on a depth image [m], or on a file; its exit status, its JSON if it wrote one, and what it said."""
    (tmp_path / "box.obj").write_text(OBJ)

    def run(depth, *more, camera=CAMERA):
        words = ["--depth", str(depth)]
        if isinstance(depth, np.ndarray):
            cv2.imwrite(str(tmp_path / "depth.png"), np.clip(np.rint(np.nan_to_num(depth, nan=0.0) * 1e4), 0, 65535).astype(np.uint16))
            (tmp_path / "camera.json").write_text(json.dumps(camera))
            words = ["--depth", str(tmp_path / "depth.png"), "--camera", str(tmp_path / "camera.json")]
        out = tmp_path / "out.json"
        out.unlink(missing_ok=True)
        status = cli.main(["locate", *words, "--part", str(tmp_path / "box.obj"), "--json", str(out), *more])
        said = capsys.readouterr().err
        assert len(said.strip().splitlines()) == (0 if status == 0 else 1)
        return status, json.loads(out.read_text()) if out.exists() else None, said

    return run


def scene(boxes=True, noise=0.0004):
    T = looking_at((0.1, -0.35, 0.55), (0.0, 0.0, 0.0))
    box = (transform(translation=(0.01, 0.0, 0.02)), np.array([0.04, 0.03, 0.02]))
    depth = cast([box] if boxes else [], T, PINHOLE, (240, 320))
    return T, depth + np.random.default_rng(0).normal(0.0, noise, depth.shape)


def points_of(depth):
    v, u = np.mgrid[: depth.shape[0], : depth.shape[1]].astype(float)
    return PINHOLE.unproject(np.stack([u, v], axis=-1), depth)


def test_a_box_is_found_and_the_view_is_described(locate, tmp_path):
    _, depth = scene()
    status, report, _ = locate(depth, "--depth-map", str(tmp_path / "map.npz"))
    assert status == 0 and report is not None
    assert report["view"]["kind"] == "pinhole" and 0.0003 < report["view"]["noise_m"] < 0.0006
    assert report["support"]["found"] and report["support"]["levels_m"][0] == 0.0
    world = np.array(report["T_world_sensor"]) @ np.array(report["poses"][0]["T_sensor_part"])
    assert abs(world[2, 3] - 0.02) < 0.002
    kept = read_depth_map(tmp_path / "map.npz")
    assert abs(np.nanmax(kept.elevation) - 0.04) < 0.003


@pytest.mark.parametrize("kind", ["ply", "pcd"])
def test_the_same_box_in_a_cloud_lies_in_the_files_own_frame(locate, tmp_path, kind):
    _, depth = scene()
    points = points_of(depth)
    T_file = transform(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), (2.0, -1.0, 0.5))
    turned = points @ T_file[:3, :3].T + T_file[:3, 3]
    if kind == "ply":
        path = write_ply(tmp_path / "a.ply", 1000.0 * points.reshape(-1, 3), "binary_little_endian")
        status, report, _ = locate(path, "--cloud-unit", "mm")
    else:
        path = write_pcd(tmp_path / "a.pcd", turned, "binary_compressed", size=8)
        status, report, _ = locate(path)
    assert status == 0 and report is not None
    pose = np.array(report["poses"][0]["T_file_part"])
    if kind == "pcd":
        assert np.allclose(report["view"]["T_file_sensor"], T_file, atol=1e-3)
        pose = np.linalg.inv(T_file) @ pose
    _, straight, _ = locate(depth)
    assert straight is not None
    assert np.linalg.norm(pose[:3, 3] - np.array(straight["poses"][0]["T_sensor_part"])[:3, 3]) < 0.002


def nothing() -> dict[str, np.ndarray]:
    """Depth images [m] with nothing to find in them."""
    rng = np.random.default_rng(1)
    return {
        "an empty table": scene(boxes=False)[1],
        "a plane that fills the view": np.full((240, 320), 0.6),
        "noise": rng.uniform(0.3, 2.0, (240, 320)),
        "a single row": np.full((1, 640), 0.6),
        "a checkerboard of holes": np.where(np.indices((240, 320)).sum(axis=0) % 2 == 0, 0.6, np.nan),
    }


@pytest.mark.parametrize("name", list(nothing()))
def test_nothing_there_is_told_with_a_reason(locate, name):
    status, report, said = locate(nothing()[name])
    assert status == 3 and report is not None and report["poses"] == []
    assert "not found" in said


@pytest.mark.parametrize("depth", [np.zeros((240, 320)), np.full((1, 1), 0.6), np.full((240, 320), np.nan)])
def test_no_readings_are_refused(locate, depth):
    status, report, said = locate(depth)
    assert status == 2 and report is None and "at least 100 are needed" in said


@pytest.mark.parametrize("bad", [np.inf, -np.inf, -0.5, 1e30, np.nan])
def test_impossible_depths_are_no_readings(locate, tmp_path, bad):
    _, depth = scene()
    points = points_of(depth)
    points[::7, ::5] = bad
    np.save(tmp_path / "a.npy", points)
    status, report, _ = locate(tmp_path / "a.npy")
    assert status == 0 and report is not None
    world = np.array(report["T_world_sensor"]) @ np.array(report["poses"][0]["T_sensor_part"])
    assert abs(world[2, 3] - 0.02) < 0.002


@pytest.mark.parametrize(
    "camera",
    [
        {**CAMERA, "fx": 4.0, "fy": 4.0},
        {**CAMERA, "fx": 1e6, "fy": 1e6},
        {**CAMERA, "cx": 1e6},
        {**CAMERA, "depth_scale": 1e-5},
        {**CAMERA, "depth_scale": 9.0},
    ],
)
def test_a_wrong_camera_gives_an_answer_or_a_sentence(locate, camera):
    status, report, said = locate(scene()[1], camera=camera)
    assert status in (0, 2, 3) and (status == 0) == (said == "")
    assert (report is None) == (status == 2)


def test_the_largest_image_is_reduced_and_stays_within_memory(locate):
    depth = np.full((4096, 4096), 0.8)
    depth[1500:2300, 1500:2600] = 0.7
    depth += np.random.default_rng(2).normal(0.0, 0.0005, 4096)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    status, report, _ = locate(depth, camera={"fx": 3500.0, "fy": 3500.0, "cx": 2047.5, "cy": 2047.5, "depth_scale": 0.1})
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * (1 if sys.platform == "darwin" else 1024)
    assert status in (0, 3) and report is not None
    assert report["view"]["reduced_by"] == 4 and report["view"]["width"] == 1024
    assert grown < 900e6
