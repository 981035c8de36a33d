"""PLY and PCD files: what is written comes back in every form, and what is broken is told in one sentence."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.sensing.reading.clouds import read_npy
from handey_studio.sensing.reading.pcd import read_pcd, unpack_lzf
from handey_studio.sensing.reading.ply import read_ply
from tests.sensing.cloud_files import pack_lzf, write_pcd, write_ply

PLY_KINDS = ("ascii", "binary_little_endian", "binary_big_endian")
PCD_KINDS = ("ascii", "binary", "binary_compressed")


@pytest.fixture
def points():
    return np.random.default_rng(0).uniform(-0.5, 0.9, (120, 3)).astype(np.float32)


@pytest.mark.parametrize("kind", PLY_KINDS)
@pytest.mark.parametrize("type_", ["float", "double"])
@pytest.mark.parametrize("extra", [False, True])
def test_a_ply_comes_back(tmp_path, points, kind, type_, extra):
    cloud = read_ply(write_ply(tmp_path / "a.ply", points, kind, type_, extra))
    assert not cloud.organised and cloud.T_cloud_sensor is None
    assert np.array_equal(cloud.points, points)


@pytest.mark.parametrize("kind", PCD_KINDS)
@pytest.mark.parametrize("size", [4, 8])
@pytest.mark.parametrize("organised", [False, True])
def test_a_pcd_comes_back_with_its_viewpoint_and_its_holes(tmp_path, points, kind, size, organised):
    points[5] = np.nan
    given_points = points.reshape(10, 12, 3) if organised else points
    cloud = read_pcd(write_pcd(tmp_path / "a.pcd", given_points, kind, "0.1 0.2 0.3 0 1 0 0", size))
    assert cloud.organised == organised
    assert np.array_equal(cloud.points, given_points, equal_nan=True)
    assert cloud.T_cloud_sensor is not None
    assert np.allclose(cloud.T_cloud_sensor, [[1, 0, 0, 0.1], [0, -1, 0, 0.2], [0, 0, -1, 0.3], [0, 0, 0, 1]])


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=600), st.integers(1, 5))
def test_lzf_unpacks_what_was_packed(data, repeats):
    data = data * repeats
    packed = np.frombuffer(pack_lzf(data), np.uint8)
    out = np.zeros(len(data), np.uint8)
    assert unpack_lzf(packed, out) == len(data)
    assert out.tobytes() == data
    if len(data) > 1:
        assert unpack_lzf(packed, np.zeros(len(data) - 1, np.uint8)) == -1


def damaged(content: bytes, data: st.DataObject) -> bytes:
    """Cut short, or with some bytes changed."""
    if data.draw(st.booleans()):
        return content[: data.draw(st.integers(0, len(content) - 1))]
    changed = bytearray(content)
    for _ in range(data.draw(st.integers(1, 6))):
        changed[data.draw(st.integers(0, min(len(changed) - 1, 400)))] = data.draw(st.integers(0, 255))
    return bytes(changed)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data(), st.sampled_from([*PLY_KINDS, *PCD_KINDS, "npy"]))
def test_damaged_files_are_read_or_told_in_one_sentence(tmp_path, data, kind):
    points = np.random.default_rng(1).uniform(0.1, 0.9, (20, 3)).astype(np.float32)
    path = tmp_path / "a"
    if kind == "npy":
        with path.open("wb") as file:
            np.save(file, points)
        reader = read_npy
    elif kind in PLY_KINDS:
        write_ply(path, points, kind)
        reader = read_ply
    else:
        write_pcd(path, points, kind)
        reader = read_pcd
    path.write_bytes(damaged(path.read_bytes(), data))
    try:
        assert reader(path).points.shape[-1] == 3
    except BadInput as told:
        assert "\n" not in str(told) and len(str(told)) < 500


@pytest.mark.parametrize(
    ("header", "said"),
    [
        (
            "ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
            "99999999999 points",
        ),
        ("ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nend_header\n", "must have x, y and z"),
        ("ply\nformat ascii 2 3\nend_header\n", "header has the line"),
        ("ply\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n", "no format"),
        ("ply\nformat ascii 1.0\nend_header\n", "no vertices"),
        (
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n",
            "ends after 1 of 3",
        ),
        (
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 x\n",
            "could not convert",
        ),
        (
            "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty int z\nend_header\n...",
            "ends after 0 of 2",
        ),
        (
            "ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list uchar int v\nelement vertex 1\nproperty float x\n"
            "property float y\nproperty float z\nend_header\n",
            "holds lists",
        ),
        ("plx\nend_header\n", 'begin with "ply"'),
        ("ply\n" + "comment x\n" * 9000, "does not end"),
    ],
)
def test_a_broken_ply_is_told(tmp_path, header, said):
    (tmp_path / "a.ply").write_text(header)
    with pytest.raises(BadInput, match=said) as told:
        read_ply(tmp_path / "a.ply")
    assert "\n" not in str(told.value)


PCD = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary\n"


@pytest.mark.parametrize(
    ("header", "said"),
    [
        (PCD, "ends after 0 of 2"),
        (PCD.replace("FIELDS x y z", "FIELDS x y"), "do not describe"),
        (PCD.replace("SIZE 4 4 4", "SIZE 4 4 3"), "type f3"),
        (PCD.replace("COUNT 1 1 1", "COUNT 1 1 0"), "COUNT"),
        (PCD.replace("COUNT 1 1 1", "COUNT 1 2 1"), "other than 1"),
        (PCD.replace("WIDTH 2", "WIDTH -2"), "whole number"),
        (PCD.replace("WIDTH 2", "WIDTH 999999999"), "999999999 points"),
        (PCD.replace("WIDTH 2", "WIDTH 60000").replace("HEIGHT 1", "HEIGHT 60000"), "60000 × 60000"),
        (PCD.replace("DATA binary", "DATA zipped"), "must be one of"),
        (PCD.replace("DATA binary", "VIEWPOINT 0 0 0 2 0 0 0\nDATA binary"), "unit quaternion"),
        (PCD.replace("DATA binary", "DATA binary_compressed"), "compressed data say 0 bytes"),
        (PCD.replace("DATA binary", ""), "does not end"),
    ],
)
def test_a_broken_pcd_is_told(tmp_path, header, said):
    (tmp_path / "a.pcd").write_text(header)
    with pytest.raises(BadInput, match=said) as told:
        read_pcd(tmp_path / "a.pcd")
    assert "\n" not in str(told.value)
