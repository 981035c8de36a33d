import numpy as np
import pytest

from handey_studio.base import Entry, Ledger, describe, frozen_array, measured, rejected_counts
from handey_studio.base.files import replace_file
from handey_studio.world import Block


def test_the_ledger_keeps_what_fell_and_why():
    ledger = Ledger()
    group = ledger.add("grasp group", "top")
    ledger.fall(group, "too wide", value=120.0, limit=100.0, unit="mm")
    ledger.add("grasp group", "side")
    assert rejected_counts(ledger.entries) == {"too wide": 1}
    assert ledger.entries[0].value == 120.0 and ledger.entries[1].reason is None


def test_adopted_entries_keep_their_tree():
    inner = Ledger()
    parent = inner.add("a", "1")
    inner.add("b", "2", parent=parent)
    outer = Ledger()
    top = outer.add("top", "0")
    outer.adopt(inner.entries, parent=top)
    assert [(e.id, e.parent) for e in outer.entries] == [(0, None), (1, 0), (2, 1)]


def test_frozen_arrays_cannot_be_written_and_do_not_alias():
    source = np.zeros(3)
    frozen = frozen_array(source)
    source[0] = 1.0
    assert frozen[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        frozen[0] = 2.0


def test_values_are_equal_and_hashed_by_content():
    a, b = (Block("wall", np.array([1.0, 2.0, 3.0]), np.eye(4)) for _ in range(2))
    c = Block("wall", np.array([1.0, 2.0, 3.1]), np.eye(4))
    assert a == b and hash(a) == hash(b) and a != c


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path, monkeypatch):
    path = tmp_path / "poses.json"
    replace_file(path, b"old")
    monkeypatch.setattr("os.fsync", lambda _: (_ for _ in ()).throw(OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        replace_file(path, b"new")
    assert path.read_bytes() == b"old" and [p.name for p in tmp_path.iterdir()] == ["poses.json"]


def test_numbers_are_read_in_millimetres_and_degrees():
    assert measured(0.00125, "m") == "1.25 mm"
    assert measured(-0.000003736, "m") == "0 mm"
    assert measured(np.pi / 2, "rad") == "90 °"
    assert measured(1.2e-4, "m²") == "120 mm²"
    assert measured(2.5, "") == "2.5"


def test_an_entry_reads_as_a_sentence():
    entry = Entry(0, None, "reach", "IK branch 1", "the arm collides", -0.013, 0.001, "m", ("forearm_link", "table"))
    assert describe(entry) == "the arm collides (forearm_link and table): -13 mm, limit 1 mm"
    assert describe(Entry(1, None, "reach", "IK branch 2")) == ""
