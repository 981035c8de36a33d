import gzip
import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio import cli
from handey_studio.base import BadInput
from handey_studio.modeling import draft_files
from handey_studio.modeling.draft import Draft, with_scan
from handey_studio.modeling.draft_files import draft_from_bytes, draft_to_bytes, read_draft, write_draft
from handey_studio.modeling.history import with_operation
from handey_studio.modeling.operations import KINDS, AlignScan, ConfirmFace, Delete, Extrude, MoveFace, SetDistance
from handey_studio.modeling.replay import replay
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.suggesting.suggestion import Suggestion
from handey_studio.modeling.taking import take
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole
from handey_studio.world.model_files import read_polyhedron
from tests.modeling.models import UP, l_draft, top_plane
from tests.modeling.test_history import at, long_draft, test_every_kind_of_step_does_what_it_says


def scanned_draft() -> Draft:
    """A draft with both kinds of scans, one aligned, a suggestion taken and edited."""
    depth = np.random.default_rng(0).uniform(0.4, 0.6, (12, 20))
    depth[3:5, 4] = np.nan
    draft = with_scan(long_draft(), Scan("from above", DepthView(depth, Orthographic(0.001, 10.0, 6.0), noise=0.0005), "range finder"))
    draft = with_scan(draft, Scan("camera", DepthView(depth, Pinhole(500.0, 501.0, 10.0, 6.0), top_plane(0.3)), "depth.png"))
    draft = with_operation(draft, AlignScan("camera", top_plane(0.01), 0.0004))
    solid = replay(draft).solid
    draft = with_operation(draft, take(Suggestion(solid, ("assumed: hidden",) * len(solid.faces), (), (), 0.0, 1.0, ())))
    return with_operation(draft, ConfirmFace(at(0, 0, 0, -UP)))


def test_a_draft_comes_back_as_it_was(tmp_path):
    draft = scanned_draft()
    write_draft(tmp_path / "part.draft", draft)
    again = read_draft(tmp_path / "part.draft")
    assert again == draft and draft_to_bytes(again) == draft_to_bytes(draft)
    built = replay(again)
    assert built == replay(draft) and built.solid is not None
    assert [path.name for path in tmp_path.iterdir()] == ["part.draft"]


def test_a_draft_without_scans_can_be_read_by_a_person():
    plain = json.loads(draft_to_bytes(l_draft()))
    assert plain["schema"] == "handey/draft/1"
    assert [step["kind"] for step in plain["operations"]] == ["box", "sketch", "extrude"]
    assert draft_from_bytes(json.dumps(plain).encode(), "typed") == l_draft()


def test_every_kind_of_step_has_its_word():
    assert all(kind == operation.kind for kind, operation in KINDS.items()) and len(KINDS) == 15
    test_every_kind_of_step_does_what_it_says()


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda plain: plain.update(schema="handey/draft/2"), "it has format 2, this version of Handey Studio reads up to 1"),
        (lambda plain: plain.update(schema="handey/session/1"), "not a draft of Handey Studio"),
        (lambda plain: plain.pop("operations"), '"operations" is missing'),
        (lambda plain: plain.update(scans="many"), '"scans" is missing or not a list'),
        (lambda plain: plain.update(operations=[{"kind": "explode"}]), 'kind of step "explode" is not known; choose one of: align scan'),
        (lambda plain: plain.update(operations=[3]), '"kind" is missing'),
        (lambda plain: plain.update(operations=[{"kind": "delete"}] * 1001), "1001 steps, the limits are 20 and 1000"),
        (lambda plain: plain["operations"][2].update(height="high"), 'step 3, "extrude": Expected `float \\| null`'),
        (lambda plain: plain["operations"][2].update(height=1e9), 'step 3, "extrude": the height of an extrusion'),
        (lambda plain: plain["operations"][2].update(depth=1), "step 3, \"extrude\", has 'depth'; it may have: combine, height"),
        (lambda plain: plain["operations"][2].update(combine="melt"), "Invalid enum value 'melt'"),
        (lambda plain: plain["operations"][0].update(clicks=[[0, 0], [1, 1]]), r"has the shape \(2, 2\)"),
        (lambda plain: plain["operations"][0].update(normal=[0, 0, 0]), "no direction"),
        (
            lambda plain: plain["operations"][1]["outline"].update(clicks=[[0, 0], [1, 0], [{"number": "nan"}, 1]]),
            r"finite numbers within ±10\.$",
        ),
        (
            lambda plain: plain["operations"][1]["outline"].update(constraints=[{"kind": "equal", "item": 0, "other": 7}]),
            r"different ones of 4 sides, counted from 0\.$",
        ),
        (lambda plain: plain["operations"][1].update(T_model_plane=np.ones((4, 4)).tolist()), "not a rigid transform"),
        (lambda plain: plain.update(scans=[{"name": "a"}]), 'scan "a": "projection" is missing'),
    ],
)
def test_broken_files_are_refused_with_one_sentence(change, match):
    plain = json.loads(draft_to_bytes(l_draft()))
    change(plain)
    with pytest.raises(BadInput, match=match) as refused:
        draft_from_bytes(json.dumps(plain).encode(), "part.draft")
    assert str(refused.value).startswith('draft "part.draft" cannot be opened: ') and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("key", "value", "match"),
    [
        ("depth", [1.0, 2.0], "rows and columns"),
        ("depth", {"dtype": "<f8", "shape": [100000, 100000], "base64": ""}, "the limit is"),
        ("T_world_sensor", np.zeros((4, 4)).tolist(), "rigid"),
        ("noise", "low", "must be a number"),
        ("noise", -1.0, "noise"),
        ("projection", {"kind": "fisheye"}, 'projection "fisheye" is not known; choose one of: orthographic, pinhole'),
        ("projection", {"kind": "pinhole", "fx": {"number": "nan"}, "fy": 1.0, "cx": 0.0, "cy": 0.0}, "fx"),
    ],
)
def test_broken_scans_are_refused(key, value, match):
    plain = json.loads(gzip.decompress(draft_to_bytes(scanned_draft())))
    plain["scans"][1][key] = value
    with pytest.raises(BadInput, match=match):
        draft_from_bytes(json.dumps(plain).encode(), "part.draft")


@settings(max_examples=60)
@given(st.data())
def test_damaged_bytes_are_refused_or_read_never_worse(data):
    whole = draft_to_bytes(replace(scanned_draft(), operations=()) if data.draw(st.booleans()) else l_draft())
    place = data.draw(st.integers(0, len(whole) - 1))
    damaged = whole[:place] if data.draw(st.booleans()) else whole[:place] + bytes([data.draw(st.integers(0, 255))]) + whole[place + 1 :]
    try:
        draft = draft_from_bytes(damaged, "damaged")
    except BadInput as error:
        assert "\n" not in str(error)
    else:
        replay(draft)


def test_a_decompression_bomb_is_not_inflated(monkeypatch):
    monkeypatch.setattr(draft_files, "MAX_CONTENT_BYTES", 1_000_000)
    with pytest.raises(BadInput, match="unpacks to more than 1000000 bytes"):
        draft_from_bytes(gzip.compress(b" " * 2_000_000), "bomb")
    monkeypatch.setattr(draft_files, "MAX_FILE_BYTES", 100)
    with pytest.raises(BadInput, match="larger than 100 bytes"):
        draft_from_bytes(b" " * 101, "large")


def test_a_nest_of_brackets_is_no_draft():
    with pytest.raises(BadInput):
        draft_from_bytes(b'{"schema": "handey/draft/1", "name": "x", "scans": [], "operations": ' + b"[" * 100_000, "nest")


def test_the_shell_replays_a_draft(tmp_path, capsys):
    path, obj, out = (tmp_path / name for name in ("part.draft", "part.obj", "out.json"))
    write_draft(path, l_draft())
    assert cli.main(["model", "replay", str(path), "--out", str(obj), "--json", str(out)]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told == [
        "1. box down to the table",
        "2. sketch step with 4 sides",
        "3. extrude step by 30 mm",
        "box: 3 steps, all done; 8 faces, 60 × 70 × 100 mm, 330 cm³.",
    ]
    assert np.isclose(read_polyhedron(obj).volume_and_centroid[0], 330e-6)
    report = json.loads(out.read_text())
    assert report["schema"] == "handey/model-replay/1"
    assert [step["reason"] for step in report["steps"]] == [None] * 3
    assert len(report["solid"]["faces"]) == 8 and report["solid"]["faces"][0]["source"].startswith("drawn")


def test_the_shell_tells_which_steps_fell(tmp_path, capsys):
    path = tmp_path / "part.draft"
    draft = with_operation(l_draft(), SetDistance(at(0.025, 0.03, 0.07), at(0.05, 0.03, 0, -UP), 0.08))
    fallen = replace(draft, operations=(*draft.operations, Extrude("gone", 0.1), MoveFace(at(0.025, 0.03, 0.08), 0.01)))
    write_draft(path, fallen)
    assert cli.main(["model", "replay", str(path)]) == 1
    assert '5. extrude gone by 100 mm: sketch "gone" is not known; choose one of: step.' in capsys.readouterr().out
    write_draft(path, with_operation(draft, Delete()))
    assert cli.main(["model", "replay", str(path)]) == 3
    assert cli.main(["model", "replay", str(tmp_path / "none.draft")]) == 2
    assert "does not exist" in capsys.readouterr().err


def test_files_keep_their_suffix_and_their_limits(tmp_path, monkeypatch):
    with pytest.raises(BadInput, match=r"must end in \.draft"):
        write_draft(tmp_path / "part.txt", l_draft())
    monkeypatch.setattr(draft_files, "MAX_CONTENT_BYTES", 100)
    with pytest.raises(BadInput, match="the limit is 100; take out a scan"):
        write_draft(tmp_path / "part.draft", l_draft())
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(BadInput, match="not valid JSON"):
        draft_from_bytes(msgspec.json.encode([1])[:-1], "part")
