"""`handey scan` and its two companions from the shell: what they write, what they print, how they end."""

import json

import cv2
import numpy as np
import pytest

from handey_studio import cli
from handey_studio.cell.recorded import read_depth_map
from handey_studio.geometry.transforms import apply, inverse, transform
from handey_studio.sensing.reading.files import read_depth
from handey_studio.sensing.stripes.instrument import Instrument
from handey_studio.sensing.stripes.instrument_file import read_instrument, write_instrument
from handey_studio.sensing.stripes.stripe_camera import StripeCamera, camera_looking_at
from tests.sensing.stripe_images import noisy, stripe

LOOK = camera_looking_at((-0.3, 0.0, 0.5), (0.0, 0.0, 0.0))
CAMERA = StripeCamera(LOOK.T_range_camera, focal_px=500.0, width=320, height=240)
PLACES = np.linspace(-0.06, 0.06, 41)  # of upright planes x = place
HEIGHT = 0.012  # of the level plate that all stripes fall on


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Green stripes on a level plate, drawn where they must fall, in a lit room; and the range finder's file."""
    folder = tmp_path_factory.mktemp("scan")
    (folder / "stripes").mkdir()
    planes = np.column_stack([np.ones(41), np.zeros((41, 2)), PLACES])
    finder = Instrument(
        (CAMERA,), ("",), planes, laser=np.array([0.0, 0.0, 0.6]), T_world_range=transform(None, (0.5, 0.1, 0.0)), cell=0.003
    )
    write_instrument(folder / "finder.json", finder)
    rng = np.random.default_rng(0)
    room = np.full((240, 320, 3), (60.0, 70.0, 65.0))
    cv2.imwrite(str(folder / "stripes" / "dark.png"), noisy(room, rng))
    y = np.linspace(-0.3, 0.3, 400)
    for k, place in enumerate(PLACES):
        line = np.column_stack([np.full(400, place), y, np.full(400, HEIGHT)])
        uv = CAMERA.project(apply(inverse(CAMERA.T_range_camera), line))[::-1]
        light = stripe(np.interp(np.arange(240), uv[:, 1], uv[:, 0]), 320, 1.2, 110.0)[..., None] * np.array([0.1, 1.0, 0.1])
        cv2.imwrite(str(folder / "stripes" / f"{k:03d}.jpg"), noisy(room + light, rng), [cv2.IMWRITE_JPEG_QUALITY, 97])
    return folder


def test_a_folder_becomes_a_cloud_a_depth_map_and_a_report(scene, tmp_path, capsys):
    outputs = ["--cloud", str(tmp_path / "c.ply"), "--json", str(tmp_path / "o.json")]
    for depth in ("d.npy", "d.png", "d.npz"):
        given = ["scan", str(scene / "stripes"), "--calibration", str(scene / "finder.json"), "--depth", str(tmp_path / depth), *outputs]
        assert cli.main(given) == 0
    told = capsys.readouterr().out
    assert "41 photographs, a stripe in 41" in told and "green laser, stripes run down" in told
    report = json.loads((tmp_path / "o.json").read_text())
    assert report["schema"] == "handey/scan/1" and report["points"] > 9000 and report["noise_m"] < 3e-4
    header, _, body = (tmp_path / "c.ply").read_bytes().partition(b"end_header\n")
    cloud = np.frombuffer(body, "<f4").reshape(-1, 3)
    assert f"element vertex {len(cloud)}".encode() in header and len(cloud) == report["points"]
    assert np.sqrt(np.mean((cloud[:, 2] - HEIGHT) ** 2)) < 3e-4
    assert np.abs(cloud[:, 0, None] - 0.5 - PLACES).min(axis=1).max() < 1e-6 and len(np.unique(np.round(cloud[:, 0], 4))) == 41
    depth_map = read_depth_map(tmp_path / "d.npz")
    assert abs(np.nanmedian(depth_map.elevation) - HEIGHT) < 1e-4 and np.isfinite(depth_map.elevation).mean() > 0.8
    for depth in ("d.npy", "d.png"):
        view = read_depth(tmp_path / depth, tmp_path / "d.camera.json").view
        points = apply(view.T_world_sensor, view.points_sensor()[np.isfinite(view.depth)])
        assert len(points) > 1500 and abs(np.median(points[:, 2]) - HEIGHT) < 2e-4
        assert np.abs(points[:, 2] - HEIGHT).max() < 0.02 and 0.4 < points[:, 0].min() < points[:, 0].max() < 0.6


def test_a_step_moves_a_fixed_plane_over_the_scene(scene, tmp_path):
    finder = read_instrument(scene / "finder.json")
    one = Instrument(finder.cameras, ("",), finder.planes[20:21])
    write_instrument(tmp_path / "one.json", one)
    (tmp_path / "same").mkdir()
    for k in range(4):
        (tmp_path / "same" / f"{k}.jpg").write_bytes((scene / "stripes" / "020.jpg").read_bytes())
    given = [
        "scan",
        str(tmp_path / "same"),
        "--calibration",
        str(tmp_path / "one.json"),
        "--step-mm",
        "2,0,0.5",
        "--cloud",
        str(tmp_path / "c.ply"),
    ]
    assert cli.main(given) == 0
    cloud = np.frombuffer((tmp_path / "c.ply").read_bytes().partition(b"end_header\n")[2], "<f4").reshape(-1, 3)
    x = np.unique(np.round(cloud[:, 0], 5))
    assert np.allclose(x, [0.0, 0.002, 0.004, 0.006], atol=1e-5)
    heights = [np.median(cloud[np.abs(cloud[:, 0] - place) < 1e-4, 2]) for place in x]
    assert np.allclose(np.diff(heights), 5e-4, atol=1e-6)


def test_photographs_without_a_stripe_end_with_nothing_found(scene, tmp_path, capsys):
    finder = read_instrument(scene / "finder.json")
    write_instrument(tmp_path / "one.json", Instrument(finder.cameras, ("",), finder.planes[20:21]))
    (tmp_path / "dark").mkdir()
    cv2.imwrite(str(tmp_path / "dark" / "a.png"), np.full((240, 320), 20, np.uint8))
    assert cli.main(["scan", str(tmp_path / "dark"), "--calibration", str(tmp_path / "one.json"), "--json", str(tmp_path / "o.json")]) == 3
    assert "no stripe was read" in capsys.readouterr().err
    report = json.loads((tmp_path / "o.json").read_text())
    assert report["points"] == 0 and report["depth_map"] is None and report["dropped"]["no stripe"] == 240


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"--calibration": "missing.json"}, "cannot be read"),
        ({"--depth": "depth.tif"}, ".npz"),
        ({"--cloud": "cloud.obj"}, ".ply"),
        ({"--cloud": "no/such/folder/c.ply"}, "does not exist"),
        ({"--channel": "infrared"}, "grey"),
        ({"--stripe": "round"}, "across"),
        ({"--step-mm": "1,2"}, "X,Y,Z"),
        ({"--cell-mm": "900"}, "cells"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_status_2(scene, change, word, capsys):
    words = {"--calibration": str(scene / "finder.json")} | change
    assert cli.main(["scan", str(scene / "stripes"), *(part for pair in words.items() for part in pair)]) == 2
    told = capsys.readouterr().err
    assert word in told and told.count("\n") == 1


def test_calibrate_tells_what_is_missing(scene, tmp_path, capsys):
    given = ["scan", "calibrate", str(scene / "stripes"), "--square-mm", "20", "--out", str(tmp_path / "f.json"), "--board"]
    assert cli.main([*given, "9by6"]) == 2 and "9x6" in capsys.readouterr().err
    assert cli.main([*given, "1x1"]) == 2 and "inner corners" in capsys.readouterr().err
    assert not (tmp_path / "f.json").exists()
    assert cli.main(["scan", "simulate", "figure1", "--out", str(scene / "stripes" / "dark.png" / "x")]) == 2
