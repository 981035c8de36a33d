"""The range finder's file: what is written is read back, planes may be given in three ways, and what cannot be is told in a sentence."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.geometry.transforms import from_xyz_rpy, transform
from handey_studio.sensing.stripes.instrument import Instrument, instrument_of
from handey_studio.sensing.stripes.instrument_file import read_instrument, write_instrument
from handey_studio.sensing.stripes.laser_planes import plane_through
from handey_studio.sensing.stripes.range_finder import RangeFinder
from handey_studio.sensing.stripes.stripe_camera import camera_looking_at

CAMERA = replace(camera_looking_at((-0.3, 0.0, 0.5), (0.0, 0.0, 0.0)), distortion=(-0.1, 0.05, 0.001, 0.0, 0.0), centre_px=(400.5, 350.25))
STAGE = Instrument(
    (CAMERA,),
    ("",),
    plane_through((1.0, 0.0, 0.1), (0, 0, 0.2))[None],
    rig_step=transform(None, (0.002, 0, 0)),
    laser=np.array([0.0, 0, 0.6]),
)


def same(a: Instrument, b: Instrument) -> bool:
    arrays = ("planes", "laser", "rig", "rig_step", "T_world_range")
    close = all(
        (getattr(a, key) is None) == (getattr(b, key) is None)
        and (getattr(a, key) is None or np.allclose(getattr(a, key), getattr(b, key)))
        for key in arrays
    )
    uv = np.array([[10.0, 20.0], [500.0, 300.0]])
    pairs = zip(a.cameras, b.cameras, strict=True)
    rays = all(np.allclose(x.rays(uv) @ x.T_range_camera[:3, :3], y.rays(uv) @ y.T_range_camera[:3, :3]) for x, y in pairs)
    return close and rays and (a.names, a.area, a.cell, a.max_height) == (b.names, b.area, b.cell, b.max_height)


@pytest.mark.parametrize(
    "instrument",
    [STAGE, instrument_of(RangeFinder()), replace(STAGE, rig_step=None, rig=np.array([from_xyz_rpy((0.1 * k, 0, 0)) for k in range(3)]))],
)
def test_an_instrument_comes_back_from_its_file(tmp_path, instrument):
    write_instrument(tmp_path / "finder.json", instrument, {"note": 1})
    assert same(read_instrument(tmp_path / "finder.json"), instrument)


@pytest.fixture
def plain(tmp_path):
    write_instrument(tmp_path / "finder.json", STAGE)
    return json.loads((tmp_path / "finder.json").read_text())


def reread(tmp_path, plain):
    (tmp_path / "changed.json").write_text(json.dumps(plain))
    return read_instrument(tmp_path / "changed.json")


def test_planes_may_turn_about_an_axis(tmp_path, plain):
    turning = {"point_m": [0, 0, 0.6], "axis": [0, -2, 0], "normal": [1, 0, 0], "angles_deg": [-10, 0, 10]}
    planes = reread(tmp_path, plain | {"laser": {"turning": turning}}).planes
    assert np.allclose(planes[1], (1, 0, 0, 0)) and np.allclose(
        planes[2], (np.cos(np.pi / 18), 0, np.sin(np.pi / 18), 0.6 * np.sin(np.pi / 18))
    )


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"schema": "other"}, "schema"),
        ({"cameras": []}, "cameras"),
        ({"cameras": [{}]}, '"fx"'),
        ({"laser": {}}, "turning"),
        ({"laser": {"plane": [1, 0, 0]}}, '"plane"'),
        ({"laser": {"plane": [0, 0, 0, 1]}}, "normal"),
        ({"laser": {"planes": [[1, 0, 0, 0], [1, 0]]}}, '"planes"'),
        ({"laser": {"turning": {"axis": [0, 0, 0], "point_m": [0, 0, 0], "normal": [1, 0, 0], "angles_deg": [1]}}}, "normal"),
        ({"rig": {}}, '"step"'),
        ({"rig": {"step": [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}}, '"step"'),
        ({"cell_m": 0}, '"cell_m"'),
        ({"cell_m": True}, '"cell_m"'),
        ({"area_m": [900, 900]}, "area"),
        ({"max_height_m": "high"}, '"max_height_m"'),
        ({"T_world_range": 3}, '"T_world_range"'),
    ],
)
def test_a_file_that_cannot_be_is_refused_in_a_sentence(tmp_path, plain, change, word):
    with pytest.raises(BadInput, match=word) as told:
        reread(tmp_path, plain | change)
    assert "changed.json" in str(told.value) and "\n" not in str(told.value)


@settings(max_examples=60, deadline=None)
@given(
    key=st.sampled_from(["cameras", "laser", "T_world_range", "cell_m", "area_m", "rig", "max_height_m"]),
    value=st.recursive(st.none() | st.floats(allow_nan=False) | st.text(max_size=3), lambda x: st.lists(x, max_size=4), max_leaves=6),
)
def test_no_value_of_any_key_does_worse_than_a_sentence(tmp_path_factory, key, value):
    folder = tmp_path_factory.mktemp("files")
    write_instrument(folder / "finder.json", STAGE)
    changed = json.loads((folder / "finder.json").read_text()) | {key: value}
    try:
        reread(folder, changed)
    except BadInput as error:
        assert "\n" not in str(error)


def test_counts_of_planes_and_poses_must_be_those_of_the_photographs():
    swept = instrument_of(replace(RangeFinder(), planes=7))
    assert len(swept.planes_of(7)) == 7 and len(STAGE.planes_of(9)) == 9
    assert np.allclose(STAGE.rig_of(4)[:, 0, 3], [0.0, 0.002, 0.004, 0.006])
    with pytest.raises(BadInput, match="6 photographs for 7"):
        swept.planes_of(6)
    with pytest.raises(BadInput, match="2 photographs for 1"):
        replace(STAGE, rig_step=None, rig=np.eye(4)[None]).rig_of(2)
