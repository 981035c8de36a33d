"""A part modelled by commands, as the screen sends them: suggestions taken, tools, history, undo, what is kept. No browser."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from handey_studio.app.commands import Redo, Undo
from handey_studio.app.modelling import derived
from handey_studio.app.modelling.accepting import Accept, Escape, accept_label
from handey_studio.app.modelling.guidance import model_step
from handey_studio.app.modelling.look import BY_HEIGHT
from handey_studio.app.modelling.parts import EditPart, NameModel, SavePart, modelled_part
from handey_studio.app.modelling.plane_tools import measurement
from handey_studio.app.modelling.scanning import CloseModel, NewModel, OpenModel, UploadScan, with_new_scan
from handey_studio.app.modelling.steps import (
    ConfirmPicked,
    EditStep,
    LookAtStep,
    MovePickedBy,
    PreviewMove,
    RemovePicked,
    RemoveStep,
    SetPicked,
    TakeModel,
)
from handey_studio.app.modelling.tool_clicks import BOX, CUT, EXTRUDE, MEASURE, MIRROR, SKETCH
from handey_studio.app.modelling.tools import ChooseTool, ClickScene, SetTool
from handey_studio.app.modelling.typed import typed_options
from handey_studio.app.modelling.workers import TASKS
from handey_studio.app.state import State, opened
from handey_studio.base import BadInput
from handey_studio.geometry import box
from handey_studio.geometry.transforms import transform
from handey_studio.modeling.draft import with_scan
from handey_studio.modeling.picking.snap import Ray
from handey_studio.modeling.scans import Scan
from handey_studio.session import session_from_bytes, session_to_bytes
from tests.modeling.looks import looking, moved, scan_of
from tests.session.samples import fresh_session, library

SIZE = (0.10, 0.06, 0.04)
EYE = np.array([0.30, -0.35, 0.40])


class Bench:
    """What actions use of the workbench; the background works at once."""

    def __init__(self, state: State) -> None:
        self.state, self.looks = state, []

    def look(self, position, look_at, client) -> None:
        self.looks.append(look_at)

    def client(self, number) -> None:
        return None

    def do(self, *commands) -> State:
        for command in commands:
            self.state = command.run(self) if hasattr(command, "run") else command.apply(self.state)
            self._work()
        return self.state

    def _work(self) -> None:
        done: dict[int, tuple] = {}
        for _ in range(12):
            for number, task in enumerate(TASKS):
                asked = task.wanted(self.state)
                if asked is not None and not _same(asked, done.get(number)):
                    done[number] = asked
                    told = task.told(asked, task.work(*asked))
                    self.state = told.run(self) if hasattr(told, "run") else told.apply(self.state)

    def click(self, point, add: bool = False) -> State:
        return self.do(ClickScene(Ray(EYE, np.subtract(point, EYE), 0.0006), add))


def _same(one, other) -> bool:
    return (
        other is not None
        and len(one) == len(other)
        and all(a is b or (isinstance(a, int | tuple) and a == b) for a, b in zip(one, other, strict=True))
    )


@lru_cache(maxsize=1)
def scan_of_carton() -> Scan:
    return scan_of([moved(box(SIZE), transform(None, (0.0, 0.0, SIZE[2] / 2)))], looking(EYE, (0.0, 0.0, 0.02)), noise=0.0005)


@pytest.fixture
def bench(tmp_path) -> Bench:
    """A carton that was scanned and whose suggested model was taken."""
    made = Bench(opened(library(tmp_path), fresh_session(tmp_path), None))
    made.state = with_new_scan(made.state, scan_of_carton())
    made.do(OpenModel())
    return made


@pytest.fixture
def carton(bench) -> Bench:
    bench.do(TakeModel())
    return bench


def solid_of(bench: Bench):
    shown = derived.built(bench.state)
    assert shown is not None and shown.solid is not None
    return shown.solid


def extent(bench: Bench, axis: int) -> float:
    return float(np.ptp(solid_of(bench).vertices[:, axis]))


def refused(bench: Bench, *commands) -> str:
    """The sentence with which the last command is refused; it changes nothing that is kept."""
    bench.do(*commands[:-1])
    before = bench.state.session.draft
    with pytest.raises(BadInput) as caught:
        bench.do(commands[-1])
    assert bench.state.session.draft is before
    return str(caught.value)


def test_a_scan_is_segmented_and_a_model_suggested_that_can_be_taken_and_taken_back(bench):
    assert model_step(bench.state)[0] == "A model is suggested" and accept_label(bench.state) == "Take this model" and bench.looks
    bench.do(Accept())
    assert np.allclose(sorted(np.ptp(solid_of(bench).vertices, axis=0)), sorted(SIZE), atol=0.002)
    assert "assumed" in model_step(bench.state)[0]
    assert derived.truth(bench.state).rms < 0.001 and derived.grasps(bench.state).classes
    bench.do(Undo())
    assert derived.built(bench.state).solid is None and accept_label(bench.state) == "Take this model"
    bench.do(Redo(), Undo(), Undo())
    assert bench.state.session.draft is None and not bench.state.modelling


def test_sizes_are_typed_and_faces_dragged_one_step_each(carton):
    carton.click((0.0, 0.0, SIZE[2]))
    height = next(typed for typed in typed_options(carton.state) if "opposite" in typed.words)
    assert height.now == pytest.approx(SIZE[2], abs=0.002)
    carton.do(SetPicked(0.045, "distance"))
    assert extent(carton, 2) == pytest.approx(0.045)
    carton.click((0.0, 0.0, 0.045))
    steps = len(carton.state.undo)
    carton.do(PreviewMove(np.array([0.0, 0.0, 0.003])), PreviewMove(np.array([0.002, 0.0, 0.006])))
    assert np.ptp(carton.state.model.preview.vertices[:, 2]) == pytest.approx(0.051) and extent(carton, 2) == pytest.approx(0.045)
    carton.do(MovePickedBy(np.array([0.002, 0.0, 0.005])))
    assert extent(carton, 2) == pytest.approx(0.05) and len(carton.state.undo) == steps + 1 and carton.state.model.preview is None


def test_an_edge_gets_its_length(carton):
    carton.click((0.02, -SIZE[1] / 2, SIZE[2]))
    assert carton.state.model.picked[0].kind == "edge"
    carton.do(SetPicked(0.12, "length"))
    assert extent(carton, 0) == pytest.approx(0.12, abs=1e-3)


def test_a_notch_is_sketched_and_cut(carton):
    top = float(solid_of(carton).vertices[:, 2].max())
    carton.do(ChooseTool(SKETCH))
    carton.click((0.0, 0.0, top))
    for x, y in ((-0.02, -0.015), (0.02, -0.0155), (0.0203, 0.015), (-0.02, 0.0152)):
        carton.click((x, y, top))
    assert len(carton.state.model.drawing.stroke.clicks) == 4 and carton.state.model.drawing.stroke.constraints
    carton.do(Undo())
    assert len(carton.state.model.drawing.stroke.clicks) == 3, "while a tool is at work undo takes back its last click"
    carton.click((-0.02, 0.0152, top))
    carton.click((-0.02, -0.015, top))
    assert carton.state.model.tool == EXTRUDE and accept_label(carton.state) == "Extrude"
    carton.do(SetTool("far", BY_HEIGHT), SetTool("height", -0.01), SetTool("combine", "cut"), Accept())
    assert len(solid_of(carton).faces) == 11
    history = [step.told for step in derived.steps(carton.state)]
    carton.do(LookAtStep(len(history) - 1))
    carton.do(EditStep(len(history) - 1, -0.02))
    floor = [v[2] for v in solid_of(carton).vertices if 1e-3 < v[2] < top - 1e-3]
    assert floor == pytest.approx([top - 0.02] * 4)


def test_cut_mirror_and_measure(carton):
    x = float(solid_of(carton).vertices[:, 0].max())
    carton.do(ChooseTool(MEASURE))
    carton.click((0.0, -SIZE[1] / 2, 0.02))
    carton.click((0.0, -SIZE[1] / 2, 0.02))
    assert measurement(carton.state).value == pytest.approx(0.0, abs=1e-6)
    carton.do(ChooseTool(CUT))
    carton.click((x, 0.0, 0.02))
    carton.do(SetTool("offset", -0.03), Accept())
    assert extent(carton, 0) == pytest.approx(SIZE[0] - 0.03, abs=0.003)
    carton.do(ChooseTool(MIRROR))
    carton.click((-0.02, -SIZE[1] / 2, 0.02))
    carton.do(SetTool("offset", 0.0), Accept())
    assert extent(carton, 1) == pytest.approx(2 * SIZE[1], abs=0.005)


def test_a_box_takes_three_clicks(bench):
    bench.do(ChooseTool(BOX))
    for x, y in ((-0.05, -0.03), (0.05, -0.03), (0.05, 0.03)):
        bench.click((x, y, SIZE[2]))
    assert np.allclose(sorted(np.ptp(solid_of(bench).vertices, axis=0)), sorted(SIZE), atol=0.003)


def test_degenerate_strokes_are_refused_with_a_sentence_and_change_nothing(carton):
    top = float(solid_of(carton).vertices[:, 2].max())
    at = [ClickScene(Ray(EYE, np.array(p) - EYE, 0.0006)) for p in ((0.0, 0.0, top), (0.01, 0.0, top), (0.02, 0.0, top))]
    assert "on the one before" in refused(carton, ChooseTool(BOX), at[0], at[0])
    assert "line" in refused(carton, ChooseTool(BOX), *at)
    assert "needs at least 3" in refused(carton, ChooseTool(SKETCH), at[0], at[0], at[1], Accept())
    assert refused(carton, ChooseTool(CUT), Accept()).startswith("click a face")
    carton.do(Escape(), Escape())
    carton.click((0.0, 0.0, top))
    assert "mm" in refused(carton, SetPicked(0.0, "distance"))
    carton.click((SIZE[0] / 2, 0.0, 0.02))
    carton.do(ChooseTool(CUT))
    carton.click((SIZE[0] / 2, 0.0, 0.02))
    assert "nothing would change" in refused(carton, SetTool("offset", 0.02), Accept())
    assert "whole solid" in refused(carton, SetTool("offset", -0.5), Accept())


def test_steps_are_looked_at_taken_out_and_refused_while_an_earlier_one_is_shown(carton):
    carton.click((0.0, 0.0, SIZE[2]))
    carton.do(SetPicked(0.05, "distance"), LookAtStep(0))
    assert extent(carton, 2) < 0.045
    carton.click((0.0, 0.0, SIZE[2]))
    assert "earlier step" in refused(carton, SetPicked(0.06, "distance"))
    carton.do(LookAtStep(0))
    assert extent(carton, 2) == pytest.approx(0.05)
    carton.do(RemoveStep(1))
    assert extent(carton, 2) < 0.045
    carton.do(RemovePicked())
    assert derived.built(carton.state).solid is None
    carton.do(Undo(), Undo())
    assert extent(carton, 2) == pytest.approx(0.05)


def test_an_assumed_face_is_confirmed(carton):
    shown = derived.built(carton.state)
    assumed = [f for f, source in enumerate(shown.sources) if source.startswith("assumed")]
    face = shown.solid.vertices[list(shown.solid.faces[assumed[0]].outer)].mean(axis=0)
    carton.do(ClickScene(Ray(face + 0.3 * shown.solid.normals[assumed[0]], -shown.solid.normals[assumed[0]], 0.0006)))
    carton.do(ConfirmPicked())
    assert len([s for s in derived.built(carton.state).sources if s.startswith("assumed")]) == len(assumed) - 1


def test_the_draft_is_in_the_session_file(carton):
    scan = carton.state.session.draft.scans[0]
    measured = replace(scan, view=replace(scan.view, noise=np.float64(0.0005)), name="scan 2")  # as measured in an image
    session = replace(carton.state.session, name="kept", draft=with_scan(carton.state.session.draft, measured))
    back = session_from_bytes(session_to_bytes(session), "kept")
    assert back.draft == session.draft
    again = Bench(opened(carton.state.library, back, None))
    again.do(OpenModel())
    assert np.allclose(solid_of(again).vertices, solid_of(carton).vertices)


def test_a_part_is_saved_edited_again_and_bundled_names_are_kept_free(carton):
    carton.do(SavePart("my carton"))
    saved = carton.state.library.part("my carton")
    assert saved.provenance.scans == ("scan 1",) and abs(saved.solid.vertices[:, 2].min()) < 1e-9
    assert np.allclose(saved.solid.vertices[:, :2].max(axis=0) + saved.solid.vertices[:, :2].min(axis=0), 0.0, atol=1e-8)
    with pytest.raises(BadInput, match="already"):
        carton.do(SavePart("my carton"))
    with pytest.raises(BadInput, match="comes with Handey Studio"):
        carton.do(SavePart("l_block"))
    volume = solid_of(carton).volume_and_centroid[0]
    carton.do(NewModel(), EditPart("my carton"))
    assert carton.state.session.draft.name == "my carton" and solid_of(carton).volume_and_centroid[0] == pytest.approx(volume)
    carton.do(EditPart("wedge"))
    wedge = carton.state.library.part("wedge").solid
    assert solid_of(carton).volume_and_centroid[0] == pytest.approx(wedge.volume_and_centroid[0])
    assert modelled_part(carton.state).name == "wedge"


def test_uploads_wait_for_one_another_and_broken_ones_are_told(bench):
    bench.do(UploadScan("a.png", b"no image"))
    assert bench.state.model.waiting is not None and "camera" in bench.state.notices[-1].text
    bench.do(UploadScan("a.json", b"{}"))
    assert bench.state.notices[-1].kind == "bad" and "/tmp" not in bench.state.notices[-1].text
    assert len(bench.state.session.draft.scans) == 1
    with pytest.raises(BadInput, match="not a scan"):
        bench.do(UploadScan("a.exe", b""))


def test_naming_closing_and_opening_change_no_geometry(carton):
    before = solid_of(carton)
    carton.do(NameModel("thing"), CloseModel())
    assert not carton.state.modelling and carton.state.session.draft.name == "thing"
    carton.do(OpenModel())
    assert solid_of(carton) == before
