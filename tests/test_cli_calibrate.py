"""`handey calibrate` from the shell."""

import json

import numpy as np
import pytest

from handey_studio import cli
from handey_studio.session import read_session
from handey_studio.session.calibrating import really_at


def test_a_misplaced_range_finder_is_found_and_saved(tmp_path, capsys):
    before, after, told = tmp_path / "before.handey", tmp_path / "after.handey", tmp_path / "told.json"
    words = ["calibrate", "figure1", "--poses", "3", "--misplaced", "10,-5,2,1.5", "--json", str(told)]
    assert cli.main([*words, "--save", str(after), "--save-before", str(before)]) == 0
    said = capsys.readouterr().out
    assert "pose 3: off by" in said and "really stands" in said
    assert json.loads(told.read_text())["status"] == "found"
    crooked, right = read_session(before), read_session(after)
    np.testing.assert_allclose(really_at(crooked), really_at(right), atol=1e-9)
    assert np.abs(right.workcell.finder.T_world_range - really_at(right)).max() < 5e-4
    assert np.abs(crooked.workcell.finder.T_world_range - really_at(crooked)).max() > 5e-3


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--misplaced", "1,2,3"], "is not X,Y,Z,YAW"),
        (["--misplaced", "1,2,nan,4"], "more than 1000 mm away"),
        (["--poses", "2"], "2 poses cannot be shown"),
        (["--cube-mm", "500"], "a cube of 500 mm cannot be shown"),
        (["--json", "/nowhere/at/all.json"], "does not exist"),
    ],
)
def test_bad_input_is_told_in_one_sentence(words, told, capsys):
    assert cli.main(["calibrate", "figure1", *words]) == 2
    said = capsys.readouterr().err
    assert told in said and said.count("\n") == 1
