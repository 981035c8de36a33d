from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.base import files as base_files
from handey_studio.geometry import Face, Polyhedron, box, polyhedron_from_polygons, prism
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.world import Library, Mate, Part, Provenance, read_part
from handey_studio.world.part_writing import as_read, check_part_name, write_part

BUNDLED = Library.choose()
TOLD = Provenance("modelled from 2 scans", ("left", 'the "other"\x7f\n'), 0.0004, 0.97, 0.81, (0,))


def library_in(folder: Path) -> Library:
    return Library(folder)


def with_window(width: float, depth: float, height: float) -> Polyhedron:
    """A block with a square hole straight through it: two faces have holes."""
    block = trimesh.creation.box((width, depth, height))
    return polyhedron_from_polygons(*_cut(block, trimesh.creation.box((width / 3, depth / 2, 2 * height))))


def _cut(block: trimesh.Trimesh, tool: trimesh.Trimesh) -> tuple[np.ndarray, list[list[int]]]:
    mesh = trimesh.boolean.difference([block, tool], engine="manifold")
    return np.asarray(mesh.vertices), np.asarray(mesh.faces).tolist()


def shape(solid: Polyhedron) -> tuple:
    """A solid's faces as sets of corners: what stays when everything is numbered anew."""
    faces = [frozenset(frozenset(tuple(solid.vertices[c].tolist()) for c in loop) for loop in face.loops) for face in solid.faces]
    return frozenset(faces), len(faces), len(solid.vertices)


lengths = st.floats(0.01, 0.2)
solids = st.one_of(
    st.builds(lambda x, y, z: box((x, y, z)), lengths, lengths, lengths),
    st.builds(with_window, lengths, lengths, lengths),
    st.builds(
        lambda a, b, c, h: prism([[0, 0], [a + c, 0], [a + c, b], [a, b], [a, b + c], [0, b + c]], h), lengths, lengths, lengths, lengths
    ),
)
angles, pitches = st.floats(-180.0, 180.0), st.floats(-85.0, 85.0)  # at 90° roll and yaw are not told apart


@given(solids, st.tuples(angles, pitches, angles), st.floats(10, 9000), st.floats(0, 2), st.text(max_size=30))
@settings(max_examples=25, deadline=None, phases=(Phase.explicit, Phase.generate))
def test_what_is_written_is_read_again(tmp_path_factory, solid, rpy, density, friction, source):
    T = from_xyz_rpy((0.1, -0.02, 0.3), np.deg2rad(rpy))
    turned = Polyhedron(solid.vertices @ T[:3, :3].T + T[:3, 3], solid.faces)
    part = Part("thing", turned, density, friction, {"on top": Mate("other", T)}, replace(TOLD, source=source))
    library = library_in(tmp_path_factory.mktemp("library"))
    kept = write_part(library, part)
    assert shape(kept.solid) == shape(turned) and np.array_equal(kept.solid.vertices, turned.vertices)
    assert all(kept.solid.faces[f] == face for f, face in enumerate(turned.faces) if not face.holes)
    assert (kept.density, kept.friction, kept.provenance.source) == (density, friction, source)
    assert kept.provenance.scans == TOLD.scans and np.abs(kept.mates["on top"].T_this_part - T).max() < 1e-10
    assert library.part("thing") == kept
    here = library.folder / "parts" / "thing.obj"
    before = {path.name: path.read_bytes() for path in here.parent.iterdir()}
    assert write_part(library, kept, overwrite=True) == kept  # written again, it is the same to the last byte
    assert {path.name: path.read_bytes() for path in here.parent.iterdir()} == before
    mesh = trimesh.load_mesh(here)
    assert isinstance(mesh, trimesh.Trimesh) and mesh.is_watertight
    assert mesh.volume == pytest.approx(solid.volume_and_centroid[0], rel=1e-6)


def test_assumed_faces_keep_their_meaning_where_faces_are_merged():
    x, y, z = 0.04, 0.05, 0.06
    corners = [[0, 0, 0], [x, 0, 0], [x, y, 0], [0, y, 0], [0, 0, z], [x, 0, z], [x, y, z], [0, y, z]]
    top, walls = [[4, 5, 6], [4, 6, 7]], [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    split = Polyhedron(np.array(corners, dtype=float), tuple(Face(tuple(p)) for p in [*top, *walls, [3, 2, 1, 0]]))
    for f in range(7):
        kept = as_read(Part("cube", split, provenance=Provenance("test", assumed_faces=(f,))))
        (assumed,) = kept.provenance.assumed_faces
        assert len(kept.solid.faces) == 6 and np.allclose(kept.solid.normals[assumed], split.normals[f])


def test_the_draft_lies_beside_and_goes_with_another_shape(tmp_path):
    library = library_in(tmp_path)
    write_part(library, Part("block", box((0.04, 0.05, 0.06))), draft=b"the history")
    assert library.drafts()["block"].read_bytes() == b"the history"
    write_part(library, Part("block", box((0.04, 0.05, 0.07))), overwrite=True)
    assert "block" not in library.drafts()
    assert sorted(path.name for path in (tmp_path / "parts").iterdir()) == ["block.obj", "block.toml"]


def test_nothing_is_written_over_unless_told(tmp_path):
    library, part = library_in(tmp_path), Part("block", box((0.04, 0.05, 0.06)))
    write_part(library, part)
    with pytest.raises(BadInput, match='a part "block" is there already; give another name'):
        write_part(library, replace(part, density=1.0))
    assert library.part("block").density == 700.0
    with pytest.raises(BadInput, match='a bundled part "l_block" is there already'):
        write_part(library, replace(part, name="l_block"))
    bundled = BUNDLED.part_files()["l_block"].read_bytes()
    assert write_part(library, replace(part, name="l_block"), overwrite=True) == library.part("l_block")  # the user's own stands in front
    assert BUNDLED.part_files()["l_block"].read_bytes() == bundled
    (tmp_path / "parts" / "mesh.stl").write_bytes(b"")
    with pytest.raises(BadInput, match="take that file away first"):
        write_part(library, replace(part, name="mesh"), overwrite=True)


@pytest.mark.parametrize("name", ["", " x", "a/b", "../x", ".hidden", "x#2", "on:x", "a.b", "x" * 61, "a\n"])
def test_names_that_are_no_files_are_refused(name, tmp_path):
    with pytest.raises(BadInput, match="cannot be used"):
        write_part(library_in(tmp_path), Part(name, box((0.04, 0.05, 0.06))))
    assert not (tmp_path / "parts").exists()
    assert check_part_name("Ölkanne groß-2_b") == "Ölkanne groß-2_b"


def test_what_is_no_solid_is_refused_and_leaves_nothing(tmp_path):
    cube = box((0.04, 0.05, 0.06))
    for solid, why in ((Polyhedron(cube.vertices, cube.faces[1:]), "holes"), (box((9.0, 1, 1)), "9.11 m across")):
        with pytest.raises(BadInput, match=why):
            write_part(library_in(tmp_path), Part("bad", solid))
    with pytest.raises(BadInput, match="density"):
        write_part(library_in(tmp_path), Part("bad", cube, density=float("nan")))
    assert not (tmp_path / "parts").exists()


def test_a_disk_that_fills_up_leaves_the_old_part_whole(tmp_path, monkeypatch):
    library, part = library_in(tmp_path), Part("block", box((0.04, 0.05, 0.06)))
    kept, written = write_part(library, part, draft=b"old"), []

    def full(handle: int) -> None:
        written.append(handle)
        if len(written) == 3:  # two of the three files are there already
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(base_files.os, "fsync", full)
    with pytest.raises(BadInput, match="No space left on device"):
        write_part(library, Part("block", box((0.05, 0.05, 0.05))), draft=b"new", overwrite=True)
    monkeypatch.undo()
    assert library.part("block") == kept and library.drafts()["block"].read_bytes() == b"old"
    assert len(list((tmp_path / "parts").iterdir())) == 3


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("density_kg_m3 = -1", "density_kg_m3 = -1; it must be"),
        ("friction = nan", "friction = nan"),
        ("mates = 3", "broken"),
        ('[provenance]\nscans = 3\nsource = "x"', "broken"),
        ('[mates.a]\npart = "x"\nxyz_m = [nan, 0, 0]', "three finite numbers"),
        ("density_kg_m3 = [", "cannot be read as TOML"),
    ],
)
def test_a_broken_sidecar_is_told_in_a_sentence(text, why, tmp_path):
    write_part(library_in(tmp_path), Part("block", box((0.04, 0.05, 0.06))))
    (tmp_path / "parts" / "block.toml").write_text(text)
    with pytest.raises(BadInput, match=why):
        read_part(tmp_path / "parts" / "block.obj")


def test_every_bundled_part_is_written_and_read_as_it_is(tmp_path):
    for name in BUNDLED.part_files():
        part = BUNDLED.part(name)
        assert write_part(library_in(tmp_path), part, overwrite=True) == part
