"""Depth files: what is written comes back, and what is broken is told in one sentence."""

import json

import cv2
import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.sensing.depth_view import Pinhole
from handey_studio.sensing.reading.files import read_depth

CAMERA = {"fx": 300.0, "fy": 310.0, "cx": 40.5, "cy": 29.5, "depth_scale": 0.1}


@pytest.fixture
def depth():
    """Depth (60, 80) [m] in whole tenths of a millimetre, 0 = none."""
    rng = np.random.default_rng(0)
    raw = np.rint(rng.uniform(5000, 9000, (60, 80)))
    raw[rng.random(raw.shape) < 0.1] = 0
    return raw * 1e-4


def write(tmp_path, depth, camera=CAMERA, name="depth.png"):
    cv2.imwrite(str(tmp_path / name), np.rint(depth * 1e4).astype(np.uint16))
    (tmp_path / "camera.json").write_text(camera if isinstance(camera, str) else json.dumps(camera))
    return tmp_path / name, tmp_path / "camera.json"


def test_a_png_comes_back_in_metres_with_holes(tmp_path, depth):
    reading = read_depth(*write(tmp_path, depth))
    assert np.allclose(np.nan_to_num(reading.view.depth), depth)
    assert reading.view.projection == Pinhole(300.0, 310.0, 40.5, 29.5)
    assert not reading.knows_world


@pytest.mark.parametrize("flat", [False, True])
def test_the_transform_is_taken_row_by_row(tmp_path, depth, flat):
    T = from_xyz_rpy((0.1, 0.2, 0.9), (3.0, 0.1, 0.2))
    given = T.ravel().tolist() if flat else T.tolist()
    reading = read_depth(*write(tmp_path, depth, {**CAMERA, "T_world_sensor": given, "width": 80, "height": 60}))
    assert reading.knows_world and np.allclose(reading.view.T_world_sensor, T)


def test_a_cloud_tells_its_own_pinhole(tmp_path, depth):
    v, u = np.mgrid[:60, :80].astype(float)
    points = Pinhole(300.0, 310.0, 40.5, 29.5).unproject(np.stack([u, v], axis=-1), np.where(depth > 0, depth, np.nan))
    np.save(tmp_path / "cloud.npy", points.astype(np.float32))
    view = read_depth(tmp_path / "cloud.npy").view
    assert isinstance(view.projection, Pinhole)
    assert np.allclose([view.projection.fx, view.projection.fy, view.projection.cx, view.projection.cy], [300, 310, 40.5, 29.5], atol=1e-2)
    assert np.allclose(view.depth, np.where(depth > 0, depth, np.nan), equal_nan=True, atol=1e-6)


def test_a_cloud_that_no_pinhole_saw_is_refused(tmp_path):
    np.save(tmp_path / "cloud.npy", np.random.default_rng(0).uniform(0.5, 1.0, (40, 40, 3)))
    with pytest.raises(BadInput, match="not the image of one pinhole"):
        read_depth(tmp_path / "cloud.npy")


@pytest.mark.parametrize(
    ("camera", "said"),
    [
        ("{", "cannot be read as JSON"),
        ("[1]", "must hold an object"),
        ({"fx": 300.0}, "lacks"),
        ({**CAMERA, "fy": "x"}, "fy is 'x'"),
        ({**CAMERA, "fx": -5.0}, "fx is '-5.0'"),
        ({**CAMERA, "cx": float("nan")}, "cx"),
        ({**CAMERA, "width": 81}, "width 81"),
        ({**CAMERA, "T_world_sensor": [1, 2, 3]}, "4 × 4"),
        ({**CAMERA, "T_world_sensor": (2 * np.eye(4)).tolist()}, "not a rigid transform"),
    ],
)
def test_a_broken_camera_is_told(tmp_path, depth, camera, said):
    with pytest.raises(BadInput, match=said) as told:
        read_depth(*write(tmp_path, depth, camera))
    assert "\n" not in str(told.value)


def test_broken_depth_is_told(tmp_path, depth):
    png, camera = write(tmp_path, depth)
    with pytest.raises(BadInput, match="does not exist"):
        read_depth(tmp_path / "none.png", camera)
    with pytest.raises(BadInput, match="needs a camera"):
        read_depth(png)
    (tmp_path / "text.png").write_text("not a picture")
    with pytest.raises(BadInput, match="not a PNG"):
        read_depth(tmp_path / "text.png", camera)
    (tmp_path / "cut.png").write_bytes(png.read_bytes()[:60])
    with pytest.raises(BadInput, match=r"damaged|channels"):
        read_depth(tmp_path / "cut.png", camera)
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((60, 80), 7, np.uint8))
    with pytest.raises(BadInput, match="one channel of uint16"):
        read_depth(tmp_path / "grey.png", camera)
    with pytest.raises(BadInput, match="has 0 readings"):
        read_depth(*write(tmp_path, np.zeros((60, 80))))
    with pytest.raises(BadInput, match="suffix"):
        read_depth(camera, camera)


def test_an_image_too_large_is_refused_before_it_is_decoded(tmp_path, depth):
    png, camera = write(tmp_path, depth)
    content = bytearray(png.read_bytes())
    content[16:20] = (60000).to_bytes(4, "big")
    png.write_bytes(content)
    with pytest.raises(BadInput, match="60000 × 60 px, the limit is 4096"):
        read_depth(png, camera)


def test_pickles_and_clouds_of_nothing_are_refused(tmp_path):
    np.save(tmp_path / "object.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(BadInput, match="cannot be read as an array"):
        read_depth(tmp_path / "object.npy")
    np.save(tmp_path / "flat.npy", np.zeros((5, 5)))
    with pytest.raises(BadInput, match=r"must be \(H, W, 3\)"):
        read_depth(tmp_path / "flat.npy")
    np.save(tmp_path / "nan.npy", np.full((50, 50, 3), np.nan))
    with pytest.raises(BadInput, match="0 readings"):
        read_depth(tmp_path / "nan.npy")
