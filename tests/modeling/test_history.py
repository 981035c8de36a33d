from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron, box
from handey_studio.modeling.constraints import Constraint
from handey_studio.modeling.draft import MAX_OPERATIONS, Draft, with_scan
from handey_studio.modeling.history import edited, removed, with_operation
from handey_studio.modeling.operations import (
    AlignScan,
    Box,
    ConfirmFace,
    CutByPlane,
    Delete,
    Extrude,
    Mirror,
    MoveCorner,
    MoveEdge,
    MoveFace,
    SetAngle,
    SetDistance,
    SetLength,
    Sketch,
    TakeSuggestion,
)
from handey_studio.modeling.outline import Outline
from handey_studio.modeling.picking.snap import MODEL, Snap
from handey_studio.modeling.references import CornerAt, EdgeAt, FaceAt
from handey_studio.modeling.replay import replay
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.sketch_plane import sketch_plane
from handey_studio.modeling.sketching import Stroke, clicked, constrained
from handey_studio.modeling.suggesting.suggestion import Alignment, Suggestion
from handey_studio.modeling.taking import reference_of, take, take_alignment
from handey_studio.sensing.depth_view import DepthView, Pinhole
from tests.modeling.models import UP, box_draft, check_built, check_solid, l_draft, top_plane

VIEW = DepthView(np.full((3, 4), 0.5), Pinhole(500, 500, 2, 2))
DOWN = -UP


def at(x, y, z, normal=UP) -> FaceAt:
    return FaceAt(np.array([x, y, z]), np.asarray(normal, dtype=float))


def size(draft: Draft) -> np.ndarray:
    return np.ptp(replay(draft).solid.vertices, axis=0)


@settings(max_examples=10)
@given(st.integers(0, 10_000), st.floats(-3.1, 3.1))
def test_a_carton_is_three_clicks_and_three_typed_numbers(seed, yaw):
    """As a hand does it: clicks with 1.5 mm of noise on a carton anywhere on the table, then what the ruler says."""
    rng = np.random.default_rng(seed)
    truth = np.array([0.182, 0.121, 0.064])
    x, y = np.array([np.cos(yaw), np.sin(yaw), 0]), np.array([-np.sin(yaw), np.cos(yaw), 0])
    corner = np.array([0.3, -0.1, truth[2]])
    clicks = np.array([corner, corner + truth[0] * x, corner + truth[1] * y + 0.1 * x]) + rng.normal(0, 0.0015, (3, 3))
    draft = with_operation(Draft("carton"), Box(clicks, UP + rng.normal(0, 0.01, 3)))
    middle = corner + 0.5 * (truth[0] * x + truth[1] * y)
    foot = middle * (1, 1, 0)
    pairs = ((middle, UP, foot, DOWN, 2), (middle + 0.5 * truth[0] * x, x, middle - 0.5 * truth[0] * x, -x, 0))
    pairs += ((middle + 0.5 * truth[1] * y, y, middle - 0.5 * truth[1] * y, -y, 1),)
    for point, normal, other, back, axis in pairs:
        shift = (0, 0, 0 if axis == 2 else -0.5 * truth[2])
        draft = with_operation(draft, SetDistance(FaceAt(point + shift, normal), FaceAt(other + shift, back), truth[axis]))
    solid = replay(draft).solid
    check_solid(solid)
    assert_allclose(solid.volume_and_centroid[0], truth.prod(), rtol=1e-9)
    assert_allclose(solid.vertices[:, 2].min(), 0.0, atol=1e-12)
    assert np.linalg.norm(solid.volume_and_centroid[1] - middle * (1, 1, 0.5)) < 0.01


@pytest.mark.parametrize("seed", range(3))
def test_figure_1s_l_block_is_an_outline_by_clicks_and_typed_lengths(seed):
    """The Figure 1 L (60 × 70 mm, arms 29.5 mm, 40 mm high), clicked with 0.5 mm of noise, turned in the plane."""
    rng = np.random.default_rng(seed)
    truth = np.array([[0, 0], [0.06, 0], [0.06, 0.0295], [0.0295, 0.0295], [0.0295, 0.07], [0, 0.07]])
    T = sketch_plane((0.3, 0.1, 0.04), UP, (np.cos(0.7), np.sin(0.7), 0))
    stroke = Stroke()
    for corner in (*truth, truth[0]):
        stroke = clicked(stroke, corner + rng.normal(0, 0.0005, 2))
    for side, length in ((0, 0.06), (1, 0.0295), (4, 0.0295), (5, 0.07)):
        stroke = constrained(stroke, Constraint("length", side, values=(length,)))
    draft = with_operation(Draft("l"), Sketch("top", T, stroke.outline))
    draft = with_operation(draft, Extrude("top"))
    solid = replay(draft).solid
    check_solid(solid)
    assert len(solid.faces) == 8
    assert_allclose(solid.volume_and_centroid[0], (0.06 * 0.0295 + 0.0295 * 0.0405) * 0.04, rtol=1e-8)
    assert_allclose([abs(e.dihedral) for e in solid.edges], np.pi / 2, atol=1e-8)
    lengths = sorted({round(1e4 * np.linalg.norm(solid.vertices[e.end] - solid.vertices[e.start])) for e in solid.edges})
    assert lengths == [295, 305, 400, 405, 600, 700]


def test_every_kind_of_step_does_what_it_says():
    draft = with_operation(l_draft(), MoveFace(at(0.025, 0.03, 0.07), 0.01))
    assert_allclose(size(draft), [0.1, 0.06, 0.08])
    draft = with_operation(draft, MoveEdge(EdgeAt(np.array([0.1, 0.03, 0.04]), np.array([0, 1.0, 0])), np.array([0.01, 0, 0.005])))
    assert_allclose(size(draft), [0.11, 0.06, 0.08])
    draft = with_operation(draft, MoveCorner(CornerAt(np.array([0.11, 0.06, 0.045])), np.array([0, 0.01, -0.005])))
    assert_allclose(size(draft), [0.11, 0.07, 0.08])
    draft = with_operation(draft, SetLength(EdgeAt(np.array([0.11, 0.07, 0.02]), UP), 0.05))
    draft = with_operation(draft, SetDistance(at(0.025, 0.03, 0.08), at(0.08, 0.03, 0.05), 0.04))
    assert_allclose(size(draft), [0.11, 0.07, 0.09])
    draft = with_operation(draft, SetAngle(at(0.05, 0.03, 0.07, (1, 0, 0)), at(0.08, 0.03, 0.05), np.deg2rad(100)))
    draft = with_operation(draft, CutByPlane(np.array([0.1, 0, 0]), np.array([1.0, 0, 0])))
    assert_allclose(size(draft), [0.1, 0.07, 0.09])
    draft = with_operation(draft, Mirror(np.array([0.1, 0, 0]), np.array([1.0, 0, 0])))
    assert_allclose(size(draft), [0.2, 0.07, 0.09])
    draft = with_operation(draft, Box(np.array([[0.02, 0, 0.09], [0.03, 0, 0.09], [0.03, 0.07, 0.09]]), UP, 0.01, "cut"))
    built = replay(draft)
    check_built(built)
    assert all(step.reason is None for step in built.steps)
    assert {"drawn: box", "set by hand", "assumed: symmetric"} <= set(built.sources)
    assert replay(with_operation(draft, Delete())).solid is None
    assert replay(with_operation(draft, Delete("step"))).sketches == ()


def test_a_suggestion_keeps_its_sources_and_an_assumed_face_is_confirmed():
    solid = Polyhedron(box((0.1, 0.06, 0.04)).vertices + np.array([0, 0, 0.02]), box((1, 1, 1)).faces)
    sources = tuple("assumed: support" if n[2] < -0.9 else "seen in scan 1" for n in solid.normals)
    draft = with_operation(Draft("part"), take(Suggestion(solid, sources, (), (), 0.001, 0.99, ())))
    built = replay(draft)
    assert_allclose(built.solid.volume_and_centroid[1], solid.volume_and_centroid[1], atol=1e-12)
    assert {tuple(np.round(n)): s for n, s in zip(built.solid.normals, built.sources, strict=True)} == {
        tuple(np.round(n)): s for n, s in zip(solid.normals, sources, strict=True)
    }
    draft = with_operation(draft, ConfirmFace(at(0, 0, 0, DOWN)))
    assert sorted(replay(draft).sources) == ["confirmed by hand"] + ["seen in scan 1"] * 5
    with pytest.raises(BadInput, match="not assumed"):
        with_operation(draft, ConfirmFace(at(0, 0, 0, DOWN)))
    with pytest.raises(BadInput, match="no solid to take: nothing is seen"):
        take(Suggestion(None, (), (), (), 0.0, 0.0, (), "nothing is seen."))


def test_scans_are_aligned_by_name():
    draft = with_scan(with_scan(Draft("part"), Scan("first", VIEW)), Scan("second", VIEW))
    pose = top_plane(0.1)
    draft = with_operation(draft, take_alignment("second", Alignment(pose, (), 0.0004, ((np.eye(4), 0.0005),), ())))
    assert_allclose(replay(draft).Ts_model_scan["second"], pose)
    assert_allclose(replay(draft).Ts_model_scan["first"], np.eye(4))
    other = take_alignment("second", Alignment(pose, (), 0.0004, ((np.eye(4), 0.0005),), ()), other=1)
    assert_allclose(replay(with_operation(draft, other)).Ts_model_scan["second"], np.eye(4))
    for scan, match in (("third", 'scan "third" is not known; choose one of: first, second'), ("first", "is the first one")):
        with pytest.raises(BadInput, match=match):
            with_operation(draft, AlignScan(scan, pose))


def test_snaps_become_references():
    snap = Snap("edge", np.ones(3), np.array([0, 0, 2.0]), np.zeros(3), MODEL, 0, "edge", 1.0)
    assert reference_of(snap) == EdgeAt(np.ones(3), UP)
    assert reference_of(replace(snap, kind="plane", normal=UP)) == FaceAt(np.ones(3), UP)
    assert reference_of(replace(snap, kind="vertex")) == reference_of(replace(snap, kind="point")) == CornerAt(np.ones(3))


REFUSED = [
    (Box(np.zeros((3, 3)), UP), "must be two corners"),
    (Box(np.array([[0, 0, 0.1], [0.1, 0, 0.1], [0.05, 0, 0.1]]), UP), "click on the side across"),
    (
        Box(np.array([[0, 0, 0.1], [0.1, 0, 0.1], [0, 0.1, 0.1]]), np.array([0, 1.0, 1])),
        "leans by 45 °; down to the table",
    ),
    (Box(np.array([[0, 0, -0.1], [0.1, 0, -0.1], [0, 0.1, -0.1]]), UP), "must lie above the table"),
    (Box(np.array([[0.2, 0, 0.1], [0.3, 0, 0.1], [0.2, 0.1, 0.1]]), UP), "they are 100 mm apart"),
    (Extrude("step", 0.0), "has no height"),
    (Extrude("nothing", 0.1), 'sketch "nothing" is not known; choose one of: step'),
    (Extrude("step", 0.02), "wholly inside the solid"),
    (CutByPlane(np.array([0, 0, -1.0]), UP), "cut off the whole solid"),
    (CutByPlane(np.array([0, 0, 1.0]), UP), "nothing would change"),
    (CutByPlane(np.array([0.05, 0.03, 0.07]), UP), "nothing would change"),
    (Sketch("cross", np.eye(4), Outline(np.array([[0, 0], [0.1, 0.1], [0.1, 0], [0, 0.1]]))), "crosses itself"),
    (MoveFace(at(0.075, 0.03, 0.04), -0.05), "the limit is"),
    (Mirror(np.array([0, 0.03, 0]), np.array([0, 1.0, 0])), "nothing would change"),
    (Mirror(np.array([-1.0, 0, 0]), np.array([1.0, 0, 0])), "do not touch"),
    (Delete("sketch"), 'sketch "sketch" is not known'),
]


@pytest.mark.parametrize(("operation", "match"), REFUSED, ids=lambda value: value if isinstance(value, str) else value.kind)
def test_degenerate_strokes_are_refused_and_change_nothing(operation, match):
    draft = l_draft()
    before = replay(draft)
    with pytest.raises(BadInput, match=match) as refused:
        with_operation(draft, operation)
    assert str(refused.value).count(". ") == 0 and str(refused.value).endswith(".")
    assert replay(draft) == before and len(draft.operations) == 3


def test_a_box_that_is_cut_away_altogether_is_refused():
    with pytest.raises(BadInput, match="would leave nothing"):
        with_operation(box_draft(), Box(np.array([[0, 0, 0.04], [0.1, 0, 0.04], [0, 0.06, 0.04]]), UP, None, "cut"))


def long_draft() -> Draft:
    """An L whose step, low top and dimensions were all edited."""
    draft = l_draft()
    step = replace(draft.operations[1], on=at(0.05, 0.03, 0.04))
    draft = edited(draft, 1, step)
    draft = with_operation(draft, MoveFace(at(0.03, 0.03, 0.07), 0.01))
    draft = with_operation(draft, MoveFace(at(0.075, 0.03, 0.04), -0.01))
    draft = with_operation(draft, SetDistance(at(0.03, 0.03, 0.08), at(0.03, 0.03, 0, DOWN), 0.1))
    draft = with_operation(draft, MoveEdge(EdgeAt(np.array([0.1, 0.03, 0.03]), np.array([0, 1.0, 0])), np.array([0.005, 0, 0.0])))
    return with_operation(draft, MoveCorner(CornerAt(np.array([0.105, 0.06, 0.03])), np.array([0, 0, 0.005])))


@pytest.mark.parametrize("height", [0.03, 0.05, 0.09, 0.2])
def test_later_steps_keep_to_their_faces_when_an_earlier_one_is_edited(height):
    """The box below the step grows far past where the step once was: each later step still edits what it was made on."""
    draft = long_draft()
    first = draft.operations[0]
    grown = edited(draft, 0, replace(first, clicks=first.clicks * (1, 1, 0) + height * UP))
    built = replay(grown)
    check_built(built)
    assert all(step.reason is None for step in built.steps)
    low = height - 0.01 + 0.005
    assert_allclose(size(grown), [0.105, 0.06, max(0.1, low)], atol=1e-12)
    assert_allclose(built.solid.volume_and_centroid[0], 0.06 * (0.05 * 0.1 + 0.055 * low), rtol=1e-9)


def test_a_step_that_no_longer_holds_stays_in_the_list_with_its_sentence():
    draft = removed(long_draft(), 2)
    built = replay(draft)
    check_built(built)
    assert len(draft.operations) == len(built.steps) == 7
    assert built.steps[0].reason is None and built.steps[1].reason is None
    assert removed(draft, 0).operations[0].kind == "sketch"
    assert "is on a face, but there is no solid" in replay(removed(draft, 0)).steps[0].reason


def test_an_edit_that_cannot_be_done_is_refused():
    draft = long_draft()
    with pytest.raises(BadInput, match="has no height"):
        edited(draft, 2, replace(draft.operations[2], height=0.0))
    for index in (-1, 8):
        with pytest.raises(BadInput, match=r"step -?\d is not there; the draft has 8 steps"):
            edited(draft, index, draft.operations[0])
        with pytest.raises(BadInput, match="is not there"):
            removed(draft, index)


def test_every_step_is_undone_and_redone_by_taking_the_draft_before():
    drafts = [long_draft()]
    while drafts[-1].operations:
        drafts.append(replace(drafts[-1], operations=drafts[-1].operations[:-1]))
    built = [replay(draft) for draft in drafts]
    for earlier, later, was in zip(drafts[1:], drafts, built, strict=False):
        again = with_operation(earlier, later.operations[-1])
        assert again == later and replay(again) == was


def test_drafts_are_bounded():
    with pytest.raises(BadInput, match="1001 steps"):
        Draft("x", operations=(Delete(),) * (MAX_OPERATIONS + 1))
    with pytest.raises(BadInput, match="two scans of the draft are called a"):
        Draft("x", scans=(Scan("a", VIEW), Scan("a", VIEW)))
    with pytest.raises(BadInput, match="0 letters"):
        Draft("")
    with pytest.raises(BadInput, match="finite"):
        at(np.nan, 0, 0)
    with pytest.raises(BadInput, match="must be a number from"):
        MoveFace(at(0, 0, 0), float("nan"))
    with pytest.raises(BadInput, match="every face needs one"):
        TakeSuggestion(np.zeros((4, 3)), (((0, 1, 2),),) * 4, ())
