import json

import numpy as np
import pytest
import trimesh

from handey_studio.cli import main
from handey_studio.world import Library


@pytest.fixture
def stl(tmp_path):
    """An L of two boxes in millimetres, as a mesh of triangles."""
    mesh = trimesh.creation.extrude_polygon(_l_shape(), 40.0)
    mesh.export(tmp_path / "ell.stl")
    return tmp_path / "ell.stl"


def _l_shape():
    import shapely

    return shapely.Polygon([(0, 0), (60, 0), (60, 30), (30, 30), (30, 70), (0, 70)])


def test_a_mesh_is_imported_listed_shown_and_found_by_name(stl, tmp_path, capsys):
    library = ["--library", str(tmp_path / "mine")]
    assert main(["part", "import", str(stl), "--units", "mm", "--density", "1000", *library]) == 0
    assert "ell: 8 faces of 20 polygons" in capsys.readouterr().out
    assert main(["part", "list", *library]) == 0
    listed = capsys.readouterr().out
    assert "ell            60 × 70 × 40 mm, 120 g, 8 faces" in listed and "l_block" in listed
    assert main(["part", "show", "ell", "--json", str(tmp_path / "ell.json"), *library]) == 0
    assert "grasp classes" in capsys.readouterr().out
    told = json.loads((tmp_path / "ell.json").read_text())
    assert (
        told["volume_m3"] == pytest.approx(120e-6, rel=1e-6) and told["grasp_classes"] > 0 and all(check["ok"] for check in told["checks"])
    )
    assert np.allclose(np.subtract(told["high_m"], told["low_m"]), (0.06, 0.07, 0.04), atol=1e-6)
    assert Library(tmp_path / "mine").part("ell").density == 1000.0


def test_bad_imports_are_told_and_write_nothing(stl, tmp_path, capsys):
    library = ["--library", str(tmp_path / "mine")]
    for more, why in (
        ([], "mm would make it"),
        (["--units", "m"], "is the unit right?"),
        (["--units", "mm", "--name", "a/b"], "cannot be used"),
    ):
        assert main(["part", "import", str(stl), *more, *library]) == 2
        assert why in capsys.readouterr().err
    assert not (tmp_path / "mine").exists()
    assert main(["part", "import", str(stl), "--units", "mm", "--name", "brick", *library]) == 2
    assert 'a bundled part "brick" is there already' in capsys.readouterr().err
    assert main(["part", "import", str(stl), "--units", "mm", "--name", "brick", "--overwrite", *library]) == 0


def test_a_broken_part_in_the_library_does_not_hide_the_others(tmp_path, capsys):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "bad.obj").write_text("v 0 0 0\n")
    assert main(["part", "list", "--library", str(tmp_path)]) == 0
    out, err = capsys.readouterr()
    assert "brick" in out and "bad.obj" in err
