"""A mesh file becomes the model by commands, as the screen sends them; and what the Part tab says of a wrong model."""

import numpy as np
import pytest
import trimesh

from handey_studio.app.commands import Redo, Undo
from handey_studio.app.modelling import derived
from handey_studio.app.modelling.accepting import Escape
from handey_studio.app.modelling.guidance import model_step
from handey_studio.app.modelling.importing import ReadMesh, UploadMesh
from handey_studio.app.modelling.parts import SavePart
from handey_studio.app.modelling.scanning import CloseModel
from handey_studio.app.modelling.steps import MovePicked, TakeModel
from handey_studio.app.panels.mesh import unit_labels
from handey_studio.app.panels.part_html import about_html, findings_html, grasps_html, numbers_html
from handey_studio.app.state import opened
from handey_studio.base import BadInput
from handey_studio.geometry import box
from tests.app.test_modelling import SIZE, Bench, solid_of
from tests.app.test_modelling import bench as bench  # a carton that was scanned
from tests.session.samples import fresh_session, library


@pytest.fixture
def empty(tmp_path) -> Bench:
    return Bench(opened(library(tmp_path), fresh_session(tmp_path), None))


def stl(mesh: trimesh.Trimesh, scale: float) -> bytes:
    return mesh.copy().apply_scale(scale).export(file_type="stl")


def cuboid(size=(0.04, 0.05, 0.06)) -> trimesh.Trimesh:
    solid = box(size)
    return trimesh.Trimesh(solid.vertices + np.array([0.3, 0.0, 0.1]), solid.triangles, process=False)


def test_the_unit_of_a_mesh_is_asked_for_and_its_part_becomes_the_model(empty):
    empty.do(UploadMesh("cube.stl", stl(cuboid(), 1000.0)))
    assert "unit" in model_step(empty.state)[0] and empty.state.session.draft is None
    assert unit_labels(empty.state.model.mesh)[0] == "mm: 40 × 50 × 60 mm" and empty.state.model.mesh.unit == "mm"
    empty.do(ReadMesh("m"))
    _, sentence, tone = model_step(empty.state)
    assert tone == "bad" and "mm would make it 87.75 mm" in sentence and "/tmp" not in sentence and empty.state.session.draft is None
    empty.do(ReadMesh("mm"))
    assert np.allclose(np.ptp(solid_of(empty).vertices, axis=0), (0.04, 0.05, 0.06), atol=1e-7)
    assert abs(solid_of(empty).vertices[:, 2].min()) < 1e-9 and empty.state.model.mesh is None and empty.looks
    assert empty.state.undo[-1].label == "import cube.stl" and derived.steps(empty.state)[0].told == "take shape with 6 faces"
    empty.do(Undo())
    assert empty.state.session.draft is None
    empty.do(Redo(), SavePart("cube"))
    assert empty.state.library.part("cube").provenance.source == "imported from cube.stl"


def test_a_rough_mesh_is_refused_with_what_helps_and_simplified_on_request(empty):
    corners, triangles = trimesh.remesh.subdivide_to_size(cuboid().vertices, np.array(cuboid().faces), 0.012)
    mesh = trimesh.Trimesh(corners, triangles)
    mesh.merge_vertices()
    mesh.vertices = mesh.vertices + np.random.default_rng(0).normal(0.0, 5e-5, mesh.vertices.shape)
    empty.do(UploadMesh("rough.ply", mesh.export(file_type="ply")), ReadMesh("m"))
    assert "planar faces, the limit is 200; simplified within" in empty.state.model.mesh.refusal
    assert "6 faces, at most" in empty.state.model.mesh.refusal and empty.state.session.draft is None
    empty.do(ReadMesh("m", empty.state.model.mesh.tolerance))
    assert len(solid_of(empty).faces) == 6 and "off its surface" in empty.state.notices[-1].text


def test_one_of_several_bodies_is_chosen(empty):
    two = trimesh.util.concatenate([cuboid(), cuboid((0.02, 0.02, 0.02)).apply_translation((0.2, 0.0, 0.0))])
    empty.do(UploadMesh("two.stl", stl(two, 1.0)), ReadMesh("m"))
    assert "choose one as the body" in empty.state.model.mesh.refusal
    empty.do(ReadMesh("m", 0.0, 2))
    assert np.ptp(solid_of(empty).vertices[:, 2]) == pytest.approx(0.02, abs=1e-6) and "body 2 of 2" in empty.state.notices[-1].text


def test_files_that_are_no_meshes_change_nothing_but_a_sentence(empty):
    with pytest.raises(BadInput, match="no mesh or CAD file"):
        empty.do(UploadMesh("photo.jpg", b"x"))
    for name, content in (("broken.stl", b"solid nothing"), ("empty.obj", b""), ("nan.obj", b"v nan 0 0\nf 1 1 1\n")):
        empty.do(UploadMesh(name, content))
        assert empty.state.notices[-1].kind == "bad" and name in empty.state.notices[-1].text and empty.state.model.mesh is None
    empty.do(UploadMesh("plan.step", b"no step"))
    assert empty.state.model.mesh.refusal and model_step(empty.state)[0] == "Not a part as it is"
    with pytest.raises(BadInput, match="the unit"):
        empty.do(ReadMesh("parsec"))
    empty.do(Escape())
    assert empty.state.model.mesh is None and empty.state.session.draft is None


def test_a_model_that_the_scans_speak_against_is_no_green_part(bench):
    bench.do(TakeModel())
    assert 'data-testid="checks"' in findings_html(derived.truth(bench.state), -1, "x") and not derived.truth(bench.state).doubts
    bench.click((0.0, 0.0, SIZE[2]))
    bench.do(MovePicked(-0.012))
    told = findings_html(derived.truth(bench.state), -1, "x")
    assert "A part, but not what was scanned" in told and "in front of face" in told and "Move it outward" in told
    assert model_step(bench.state)[::2] == ("The scans disagree", "warn") and "%" in model_step(bench.state)[1]


def test_what_the_hand_can_grasp_is_told_with_pictures_and_why_not(bench):
    bench.do(TakeModel())
    found = derived.grasps(bench.state)
    assert grasps_html(found).count("<svg") == min(6, len(found.classes)) > 0 and found.group_count > len(found.classes)
    bench.do(UploadMesh("crate.obj", b""), UploadMesh("crate.stl", stl(cuboid((0.2, 0.2, 0.2)), 1.0)), ReadMesh("m"))
    assert "nothing: " in numbers_html(bench.state) and "limit" in numbers_html(bench.state)
    assert grasps_html(derived.grasps(bench.state)) == ""


def test_a_pane_without_a_solid_says_what_to_do(bench):
    assert "No solid yet" in about_html(bench.state)
    bench.do(TakeModel(), CloseModel())
    assert "Continue the model" in about_html(bench.state)
