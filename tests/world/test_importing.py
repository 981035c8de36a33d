from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron, box
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.world import Library
from handey_studio.world.importing import UNITS, ImportOptions, import_part
from handey_studio.world.simplify import simplified

LIBRARY = Library.choose()
MM = ImportOptions("mm")


def mesh_of(solid: Polyhedron) -> trimesh.Trimesh:
    return trimesh.Trimesh(solid.vertices, solid.triangles, process=False)


def in_mm(mesh: trimesh.Trimesh, path: Path) -> Path:
    mesh.copy().apply_scale(1000.0).export(path)
    return path


def rough(solid: Polyhedron, edge: float, sigma: float, seed: int = 0) -> trimesh.Trimesh:
    """The solid's surface as a scanner gives it: many small triangles, noise on each corner."""
    fine = trimesh.remesh.subdivide_to_size(solid.vertices, np.array(solid.triangles), edge)
    mesh = trimesh.Trimesh(fine[0], fine[1])
    mesh.merge_vertices()
    return trimesh.Trimesh(mesh.vertices + np.random.default_rng(seed).normal(0, sigma, mesh.vertices.shape), mesh.faces, process=False)


def corner_error(solid: Polyhedron, truth: Polyhedron) -> float:
    """How far [m] the farthest corner is from one of the truth's; infinite if there are not as many."""
    if len(solid.vertices) != len(truth.vertices) or len(solid.faces) != len(truth.faces):
        return float("inf")
    return float(np.linalg.norm(solid.vertices[:, None] - truth.vertices, axis=2).min(axis=1).max())


@pytest.mark.parametrize("name", sorted(LIBRARY.part_files()))
@pytest.mark.parametrize("suffix", [".stl", ".ply", ".off", ".obj"])
def test_a_part_comes_back_through_every_format_in_millimetres(name, suffix, tmp_path):
    truth = LIBRARY.part(name).solid
    made = import_part(in_mm(mesh_of(truth), tmp_path / f"thing{suffix}"), MM)
    assert corner_error(made.part.solid, truth) < 1e-6
    assert (made.part.name, made.bodies, made.deviation, made.triangles) == ("thing", 1, 0.0, len(truth.triangles))
    assert made.part.provenance.source == f"imported from thing{suffix}"


@given(st.integers(0, 10**6), st.sampled_from(sorted(UNITS)))
@settings(max_examples=25, deadline=None, phases=(Phase.explicit, Phase.generate))
def test_a_soup_of_triangles_in_any_unit_and_pose_becomes_its_part(tmp_path_factory, seed, unit):
    rng = np.random.default_rng(seed)
    names = sorted(LIBRARY.part_files())
    truth, T = LIBRARY.part(names[seed % len(names)]).solid, from_xyz_rpy(rng.uniform(-0.1, 0.1, 3), rng.uniform(-3, 3, 3))
    corners = truth.vertices @ T[:3, :3].T + T[:3, 3]
    soup = corners[truth.triangles[rng.permutation(len(truth.triangles))]].reshape(-1, 3)  # no corner is shared
    mesh = trimesh.Trimesh(soup / UNITS[unit], np.arange(len(soup)).reshape(-1, 3), process=False)
    path = tmp_path_factory.mktemp("soup") / "soup.ply"
    mesh.export(path, vertex_normal=False)
    made = import_part(path, ImportOptions(unit))
    assert corner_error(made.part.solid, Polyhedron(corners, truth.faces)) < 2e-6


@pytest.mark.parametrize("inside_out", [False, True])
def test_an_inside_out_mesh_is_turned(inside_out, tmp_path):
    mesh = mesh_of(box((0.04, 0.05, 0.06)))
    if inside_out:
        mesh.invert()
    made = import_part(in_mm(mesh, tmp_path / "box.stl"), MM)
    assert made.part.solid.volume_and_centroid[0] == pytest.approx(0.04 * 0.05 * 0.06, rel=1e-5)


def test_the_unit_is_asked_for_and_guessed(tmp_path):
    path = in_mm(mesh_of(box((0.04, 0.05, 0.06))), tmp_path / "box.stl")
    with pytest.raises(BadInput, match=r"no unit; say which: m, cm, mm, in \(87.75 across: mm would make it 87.75 mm\)"):
        import_part(path, ImportOptions())
    with pytest.raises(BadInput, match=r"in m it would be 87.75 m across: mm would make it 87.75 mm; .* is the unit right\?"):
        import_part(path, ImportOptions("m"))
    mesh_of(box((0.04, 0.05, 0.06))).export(tmp_path / "metres.stl")
    with pytest.raises(BadInput, match=r": m would make it 87\.75 mm"):
        import_part(tmp_path / "metres.stl", MM)


@pytest.mark.parametrize(("edge", "sigma", "tolerance"), [(0.01, 0.0, 0.0005), (0.004, 0.0002, 0.001), (0.003, 0.0003, 0.002)])
@pytest.mark.parametrize("name", ["bracket", "wedge"])
def test_a_rough_scan_is_simplified_to_what_it_was(name, edge, sigma, tolerance, tmp_path):
    truth = LIBRARY.part(name).solid
    mesh = rough(truth, edge, sigma)
    made = import_part(in_mm(mesh, tmp_path / "scan.ply"), ImportOptions("mm", simplify_m=tolerance))
    assert corner_error(made.part.solid, truth) < max(1e-6, 0.5 * sigma)
    assert made.deviation <= 2 * tolerance
    for f, face in enumerate(made.part.solid.faces):
        corners = made.part.solid.vertices[[c for loop in face.loops for c in loop]]
        assert np.abs(corners @ made.part.solid.normals[f] - made.part.solid.offsets[f]).max() < 1e-9  # exactly planar


def test_the_deviation_is_that_of_the_farthest_corner():
    truth = box((0.06, 0.05, 0.04))
    mesh = rough(truth, 0.01, 0.0)
    corners = np.array(mesh.vertices)
    top = np.argmin(np.linalg.norm(corners - (0.0, 0.0, 0.02), axis=1))
    corners[top, 2] += 0.0007  # a bump
    made = simplified(corners, np.array(mesh.faces), 0.001)
    assert 0.0006 < made.deviation <= 0.0007 and len(made.solid.faces) == 6


def test_a_rough_scan_is_refused_with_what_would_help(tmp_path):
    path = in_mm(rough(LIBRARY.part("l_block").solid, 0.004, 0.0002), tmp_path / "scan.stl")
    with pytest.raises(BadInput, match=r"triangles, the limit is 5000; simplified within (1|2) mm it would have 8 faces"):
        import_part(path, MM)
    coarse = in_mm(rough(LIBRARY.part("l_block").solid, 0.012, 0.0002), tmp_path / "coarse.stl")
    with pytest.raises(BadInput, match=r"planar faces, the limit is 200; simplified within (0.5|1|2) mm it would have 8 faces"):
        import_part(coarse, MM)


def test_round_things_are_no_parts(tmp_path):
    path = in_mm(trimesh.creation.icosphere(subdivisions=2, radius=0.15), tmp_path / "ball.stl")
    with pytest.raises(BadInput, match="only shapes with flat faces can be parts"):
        import_part(path, MM)
    with pytest.raises(BadInput, match=r"planes|round|off somewhere|meet in a corner"):
        import_part(path, ImportOptions("mm", simplify_m=0.0005))


def test_several_bodies_are_told_and_one_is_chosen(tmp_path):
    large, small = mesh_of(box((0.04, 0.05, 0.06))), mesh_of(box((0.02, 0.02, 0.02)))
    small.apply_translation((0.1, 0, 0))
    both = trimesh.util.concatenate([small, large])
    assert isinstance(both, trimesh.Trimesh)
    path = in_mm(both, tmp_path / "two.stl")
    with pytest.raises(
        BadInput, match=r"2 surfaces that do not touch, .* choose one as the body \(1: 40 × 50 × 60 mm; 2: 20 × 20 × 20 mm\)"
    ):
        import_part(path, MM)
    for body, volume in ((1, 120e-6), (2, 8e-6)):
        made = import_part(path, ImportOptions("mm", body=body))
        assert made.part.solid.volume_and_centroid[0] == pytest.approx(volume, rel=1e-4) and made.bodies == 2
    with pytest.raises(BadInput, match="no body 3; choose from 1 to 2"):
        import_part(path, ImportOptions("mm", body=3))


def broken_files(folder: Path) -> dict[str, tuple[Path, str]]:
    cube = box((40.0, 50.0, 60.0))
    nan = np.array(cube.vertices)
    nan[0, 0] = np.nan
    fin = np.concatenate([cube.triangles, [[0, 7, 8]]])  # one triangle more on an edge
    cases = {
        "open": (trimesh.Trimesh(cube.vertices, cube.triangles[1:], process=False), "holes: 3 sides"),
        "fin": (trimesh.Trimesh(np.r_[cube.vertices, [[99, 99, 99]]], fin, process=False), "holes"),
        "mixed": (trimesh.Trimesh(cube.vertices, np.r_[cube.triangles[:1, ::-1], cube.triangles[1:]], process=False), "holes|both ways"),
        "flat": (trimesh.Trimesh(cube.vertices * (1, 1, 0), cube.triangles, process=False), "no triangles|holes|volume|more than two"),
        "nan": (trimesh.Trimesh(nan, cube.triangles, process=False), "not a finite number"),
    }
    for name, (mesh, _) in cases.items():
        mesh.export(folder / f"{name}.off")
    (folder / "empty.off").write_text("OFF\n0 0 0\n")
    (folder / "text.stl").write_text("this is no mesh")
    (folder / "thing.dae").write_text("")
    told = {name: (folder / f"{name}.off", why) for name, (_, why) in cases.items()}
    told["empty"] = folder / "empty.off", "no surface|cannot be read"
    return told | {
        "text": (folder / "text.stl", "cannot"),
        "kind": (folder / "thing.dae", 'suffix ".dae"'),
        "none": (folder / "x.stl", "not exist"),
    }


@pytest.mark.parametrize("name", ["open", "fin", "mixed", "flat", "nan", "empty", "text", "kind", "none"])
def test_broken_files_are_told_in_one_sentence(name, tmp_path):
    path, why = broken_files(tmp_path)[name]
    with pytest.raises(BadInput, match=why) as told:
        import_part(path, MM)
    assert str(told.value).startswith(f'"{path}" cannot be imported: ') and str(told.value).count("\n") == 0


def test_a_huge_file_is_not_even_read(tmp_path, monkeypatch):
    monkeypatch.setattr("handey_studio.world.model_files.MAX_MODEL_BYTES", 100)
    path = in_mm(mesh_of(box((0.04, 0.05, 0.06))), tmp_path / "box.stl")
    with pytest.raises(BadInput, match="the limit is 100"):
        import_part(path, MM)


def test_simplifying_within_nonsense_is_refused(tmp_path):
    path = in_mm(mesh_of(box((0.04, 0.05, 0.06))), tmp_path / "box.stl")
    for tolerance in (0.0, -1.0, 0.5, float("nan")):
        with pytest.raises(BadInput, match=r"0.001 to 20 mm"):
            import_part(path, ImportOptions("mm", simplify_m=tolerance))
