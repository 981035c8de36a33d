"""The `.handey` file: what is written comes back, and what is damaged is told in one sentence."""

import gzip
import json
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from handey_studio.base import BadInput, documents
from handey_studio.base.coding import from_plain, plain_array, to_plain
from handey_studio.base.documents import GZIP_MAGIC
from handey_studio.session import files, find_session, own_file, read_session, session_from_bytes, session_to_bytes, write_session
from tests.session.samples import fresh_session, full_session, library


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    return full_session(tmp_path_factory.mktemp("library"))


@pytest.fixture(scope="module")
def fresh(tmp_path_factory):
    return fresh_session(tmp_path_factory.mktemp("library"))


def plain_of(session) -> dict:
    """The JSON inside a session's file."""
    data = session_to_bytes(session)
    return json.loads(gzip.decompress(data) if data.startswith(GZIP_MAGIC) else data)


def refused(plain) -> str:
    """The sentence with which this JSON is refused."""
    with pytest.raises(BadInput) as caught:
        session_from_bytes(json.dumps(plain).encode(), "x.handey")
    sentence = str(caught.value)
    assert "\n" not in sentence and sentence.startswith('session "x.handey" cannot be opened: ') and sentence.endswith(".")
    return sentence


def test_a_full_session_comes_back_equal(full, tmp_path):
    hash(full)  # fills the caches that must not reach the file
    write_session(tmp_path / "a.handey", full)
    assert read_session(tmp_path / "a.handey") == full
    assert list(tmp_path.iterdir()) == [tmp_path / "a.handey"]
    assert session_to_bytes(full) == session_to_bytes(read_session(tmp_path / "a.handey"))


def test_a_session_without_a_scan_is_readable_text(fresh):
    data = session_to_bytes(fresh)
    assert json.loads(data)["commands"] == [{"part": "l_block", "to": "0.35,-0.35,0,0,0,90"}]
    assert session_from_bytes(data, "x") == fresh


def test_the_grasp_plane_comes_back_cell_by_cell(full):
    back = session_from_bytes(session_to_bytes(full), "x").results[0].plan
    np.testing.assert_array_equal(back.carries[0].approach.plane.fingers, full.results[0].plan.carries[0].approach.plane.fingers)


DTYPES = st.sampled_from(["<f8", "<f4", "<i8", "<i4", "|u1", "|b1"])
ARRAYS = hnp.arrays(DTYPES, hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=30))


@given(ARRAYS)
@settings(max_examples=150, deadline=None)
def test_every_array_comes_back_bit_for_bit(array):
    plain = msgspec.json.decode(msgspec.json.encode(to_plain({"a": array})))
    back = from_plain(plain, dict)["a"]
    assert back.dtype == array.dtype and back.shape == array.shape and back.tobytes() == array.tobytes()


@given(st.floats())
def test_every_number_comes_back(number):
    back = from_plain(msgspec.json.decode(msgspec.json.encode(to_plain({"n": number}))), dict)["n"]
    assert back == number or (np.isnan(back) and np.isnan(number))


@given(st.data())
@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_damaged_file_is_told_in_a_sentence(full, data):
    whole = bytearray(session_to_bytes(full))
    if data.draw(st.booleans(), label="cut"):
        whole = whole[: data.draw(st.integers(0, len(whole) - 1))]
    for _ in range(data.draw(st.integers(0, 4), label="flips") if whole else 0):
        whole[data.draw(st.integers(0, len(whole) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        back = session_from_bytes(bytes(whole), "x")
    except BadInput as error:
        assert str(error).startswith('session "x" cannot be opened: ')
    else:  # flipped bits of gzip's header that nobody reads
        assert back == full


def _paths(plain, path=()):
    yield path
    items = plain.items() if isinstance(plain, dict) else enumerate(plain[:3]) if isinstance(plain, list) else ()
    for key, item in items:
        yield from _paths(item, (*path, key))


HOSTILE_ARRAYS = [{"array": [1, "a"]}, {"array": []}, {"dtype": "|O", "shape": [1], "base64": "AA=="}]
JUNK = st.sampled_from([None, -1, 1e308, "x", [], {}, [[]], {"number": "nan"}, True, [None], *HOSTILE_ARRAYS])


@given(st.data())
@settings(max_examples=250, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_hostile_json_never_escapes_as_anything_but_a_sentence(full, data):
    plain = plain_of(full)
    path = data.draw(st.sampled_from([p for p in _paths(plain) if p]))
    inner = plain
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = data.draw(JUNK)
    try:
        session_from_bytes(json.dumps(plain).encode(), "x")
    except BadInput as error:
        assert "\n" not in str(error)


def test_a_newer_version_is_refused_clearly(fresh):
    sentence = refused(plain_of(fresh) | {"schema": "handey/session/4"})
    assert "format 4" in sentence and "up to 3" in sentence and "update" in sentence


@pytest.mark.parametrize("schema", [None, "", "handey/session/", "handey/session/one", "handey/move/1", 1, "handey/session/0"])
def test_what_is_no_session_is_refused(fresh, schema):
    assert "handey/session/3" in refused(plain_of(fresh) | {"schema": schema})


def test_a_skewed_frame_is_refused_by_its_path(full):
    plain = plain_of(full)
    plain["scene"]["instances"][0]["T_world_part"]["array"][0][0] = 2.0
    assert "session.scene.instances[0].T_world_part is not a rigid 4×4 transform" in refused(plain)


def test_a_part_with_a_hole_is_refused(full):
    plain = plain_of(full)
    plain["parts"][0]["solid"]["faces"].pop()
    assert "session.parts[0].solid is not a closed solid" in refused(plain)


def test_a_plan_whose_times_run_backwards_is_refused(full):
    plain = plain_of(full)
    plain["results"][0]["plan"]["steps"][0]["time_s"]["array"][3] = -1.0
    assert "times that run backwards" in refused(plain)


def test_not_finite_numbers_are_refused(full):
    plain = plain_of(full)
    plain["view"]["camera_position"] = plain_array(np.array([1.0, 2.0, np.inf]))
    assert "session.view.camera_position" in refused(plain)


def test_an_array_that_claims_more_than_the_limit_is_refused_unread(full):
    plain = plain_of(full)
    plain["scene"]["depth_map"]["elevation"]["shape"] = [10_000, 10_000]
    assert "the limit is 20000000" in refused(plain)


def test_too_many_commands_are_refused(fresh):
    plain = plain_of(fresh)
    plain["commands"] *= 501
    assert "501 commands, the limit is 500" in refused(plain)


def test_a_decompression_bomb_is_not_inflated(monkeypatch, full):
    monkeypatch.setattr(files, "MAX_CONTENT_BYTES", 1_000_000)
    bomb = gzip.compress(b" " * 50_000_000)
    assert len(bomb) < 100_000
    with pytest.raises(BadInput, match="unpacks to more than 1000000 bytes"):
        session_from_bytes(bomb, "x")


def test_what_would_grow_a_hundredfold_in_memory_is_refused_unread(monkeypatch, fresh):
    monkeypatch.setattr(documents, "MOST_VALUES", 20_000)
    assert "more than 20000 values" in refused(plain_of(fresh) | {"name": [[]] * 20_000})
    with pytest.raises(BadInput, match=r"holds 20001 values, the limit is 20000; take out a scan"):
        documents.packed({"steps": [0] * 20_001}, 10**6, "it", "take out a scan")


def test_a_file_over_the_limit_is_refused(monkeypatch, full, tmp_path):
    write_session(tmp_path / "a.handey", full)
    monkeypatch.setattr(files, "MAX_FILE_BYTES", 100)
    with pytest.raises(BadInput, match="larger than 100 bytes"):
        read_session(tmp_path / "a.handey")


def test_deep_nesting_is_refused():
    for depth in (600, 900, 3000, 100_000):
        with pytest.raises(BadInput):
            session_from_bytes(b'{"schema": "handey/session/1", "name": ' + b"[" * depth + b"]" * depth + b"}", "x")


def test_a_write_that_fails_leaves_the_old_file_whole(full, fresh, tmp_path, monkeypatch):
    path = tmp_path / "a.handey"
    write_session(path, fresh)

    def full_disk(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full_disk)
    with pytest.raises(BadInput, match="No space left on device"):
        write_session(path, full)
    assert read_session(path) == fresh and list(tmp_path.iterdir()) == [path]


def test_missing_files_and_folders_are_told(fresh, tmp_path):
    with pytest.raises(BadInput, match="does not exist"):
        read_session(tmp_path / "none.handey")
    with pytest.raises(BadInput, match="cannot be read"):
        read_session(tmp_path)
    with pytest.raises(BadInput, match=r"must end in \.handey"):
        write_session(tmp_path / "a.json", fresh)


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "a\\b", ".hidden", " a", "a\n", "x" * 121, "a:b", "\0"])
def test_names_that_could_leave_the_library_are_refused(tmp_path, name):
    with pytest.raises(BadInput, match="cannot be used"):
        own_file(library(tmp_path), name)


def test_sessions_are_found_by_name_and_by_path(fresh, tmp_path):
    shelf = library(tmp_path)
    write_session(own_file(shelf, "my pile"), replace(fresh, name="my pile"))
    assert find_session(shelf, "my pile") == tmp_path / "sessions" / "my pile.handey"
    assert find_session(shelf, "sessions/my pile") == tmp_path / "sessions" / "my pile.handey"
    assert find_session(shelf, str(tmp_path / "other.handey")) == Path(tmp_path / "other.handey")
    with pytest.raises(BadInput, match=r'session "nothing" is not known; choose one of: .*my pile'):
        find_session(shelf, "nothing")


def test_small_arrays_are_readable_and_large_ones_are_bytes():
    assert plain_array(np.eye(4)).keys() == {"array"}
    assert plain_array(np.zeros((20, 20))).keys() == {"dtype", "shape", "base64"}
    assert plain_array(np.array([np.nan])).keys() == {"dtype", "shape", "base64"}


def test_a_session_of_the_first_format_opens_with_its_plan(full):
    """There a plan was one carry, whose values stood in the plan itself."""
    plain = plain_of(full) | {"schema": "handey/session/1"}
    for result in plain["results"]:
        plan = result["plan"]
        if plan is not None:
            (carry,) = plan.pop("carries")
            plan |= {key: carry[key] for key in ("T_world_part_start", "T_world_part_goal", "grasp", "approach", "space")} | {"regrasps": 0}
    back = session_from_bytes(json.dumps(plain).encode(), "old")
    assert session_to_bytes(back) == session_to_bytes(full)
