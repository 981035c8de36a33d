import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from handey_studio.base import BadInput
from handey_studio.modeling.constraints import Constraint, equation
from handey_studio.modeling.outline import Outline, sound_corners
from handey_studio.modeling.sketch_plane import guides_in_plane, sketch_plane
from handey_studio.modeling.sketching import Guides, SketchOptions, Stroke, clicked, closed, constrained, switched, undone

L = np.array([[0, 0], [0.08, 0], [0.08, 0.03], [0.045, 0.03], [0.045, 0.07], [0, 0.07]])
EVERY_KIND = (
    Constraint("horizontal", 0),
    Constraint("vertical", 4),
    Constraint("along", 1, values=(0.3,)),
    Constraint("parallel", 0, 2),
    Constraint("perpendicular", 1, 2),
    Constraint("equal", 1, 3),
    Constraint("length", 2, values=(0.7,)),
    Constraint("at", 1, values=(0.3, 0.2)),
    Constraint("on line", 3, values=(0.1, -0.2, 0.4)),
)


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s], [-s, c]])


def drawn(corners: np.ndarray, rng: np.random.Generator, noise: float, guides: Guides = Guides()) -> Stroke:
    """The clicks of a hand on each corner and again on the first."""
    stroke = Stroke()
    for corner in (*corners, corners[0]):
        stroke = clicked(stroke, corner + rng.normal(0.0, noise, 2), guides)
    return stroke


@pytest.mark.parametrize("constraint", EVERY_KIND, ids=lambda constraint: constraint.kind)
def test_slopes_are_those_of_finite_differences(constraint):
    corners = np.random.default_rng(3).normal(size=(5, 2))
    slopes = equation(corners, constraint)[1]
    step = 1e-6
    for k in range(10):
        ahead = np.zeros(10)
        ahead[k] = step
        values = [equation(corners + sign * ahead.reshape(5, 2), constraint)[0] for sign in (1, -1)]
        assert_allclose(slopes[:, k], (values[0] - values[1]) / (2 * step), atol=1e-7)


@given(st.integers(0, 10_000), st.floats(-0.6, 0.6))
def test_a_noisy_rectangle_comes_out_square_wherever_it_is_turned(seed, angle):
    rng = np.random.default_rng(seed)
    clicks = turned(np.array([[0, 0], [0.1, 0], [0.1, 0.06], [0, 0.06]]), angle) + rng.normal(0.0, 0.001, (4, 2))
    asked = (Constraint("perpendicular", 1, 0), Constraint("perpendicular", 2, 1), Constraint("perpendicular", 3, 2))
    outline = Outline(clicks, asked)
    sides = np.roll(outline.corners, -1, axis=0) - outline.corners
    lengths = np.linalg.norm(sides, axis=1)
    assert_allclose(np.einsum("ij,ij->i", sides, np.roll(sides, -1, axis=0)) / lengths**2, 0.0, atol=1e-8)
    assert np.abs(outline.corners - clicks).max() < 0.005


def test_no_other_square_is_nearer_to_the_clicks():
    """The constrained corners against a brute search over rectangles: position, angle and two sides."""
    from scipy.optimize import minimize

    clicks = np.array([[0.001, 0.0], [0.1, 0.003], [0.099, 0.062], [-0.002, 0.06]])
    asked = tuple(Constraint("perpendicular", k + 1, k) for k in range(3))

    def rectangle(x):
        return x[:2] + turned(np.array([[0, 0], [x[3], 0], [x[3], x[4]], [0, x[4]]]), x[2])

    best = minimize(
        lambda x: 1e6 * ((rectangle(x) - clicks) ** 2).sum(), [0, 0, 0, 0.1, 0.06], method="Nelder-Mead", options={"maxiter": 4000}
    )
    assert ((Outline(clicks, asked).corners - clicks) ** 2).sum() <= 1.02e-6 * best.fun


def test_an_l_is_drawn_by_clicks_and_its_lengths_typed():
    stroke = drawn(L, np.random.default_rng(5), 0.0005)
    assert stroke.closed
    assert [c.kind for c in stroke.constraints if c.kind in ("horizontal", "vertical")] == ["horizontal", "vertical"] * 3
    for side, length in ((0, 0.08), (1, 0.03), (4, 0.045), (5, 0.07)):
        stroke = constrained(stroke, Constraint("length", side, values=(length,)))
    assert_allclose(stroke.corners - stroke.corners[0], L, atol=1e-9)


def test_an_l_that_is_turned_follows_its_first_side():
    stroke = drawn(turned(L, 0.4), np.random.default_rng(6), 0.0003)
    sides = np.roll(stroke.corners, -1, axis=0) - stroke.corners
    cosines = np.einsum("ij,ij->i", sides, np.roll(sides, -1, axis=0))
    assert_allclose(cosines, 0.0, atol=1e-9)
    assert_allclose(turned(stroke.corners, -0.4), L, atol=0.002)


def test_what_is_inferred_is_told_and_can_be_switched_off():
    stroke = drawn(turned(L, 0.4), np.random.default_rng(6), 0.0005)
    index = next(k for k, c in enumerate(stroke.constraints) if c.kind == "perpendicular" and c.item == 1)
    assert (stroke.constraints[index].told, stroke.constraints[index].place) == ("⟂ side 1", "side 2")
    off = switched(stroke, index, False)
    assert not off.constraints[index].on
    assert np.abs(off.corners - stroke.corners).max() > 1e-6
    assert switched(off, index, True) == stroke


def test_without_inference_only_the_clicks_count():
    stroke = Stroke()
    for corner in L:
        stroke = clicked(stroke, corner, options=SketchOptions(infer=False))
    assert stroke.constraints == ()
    assert_allclose(stroke.corners, L)


def test_clicks_snap_to_points_edges_and_run_along_what_is_seen():
    guides = Guides(np.array([[0.0, 0.0]]), np.array([[[0.1, -0.1], [0.1, 0.1]]]), np.array([0.5]))
    stroke = clicked(clicked(Stroke(), (0.001, -0.001), guides), (0.0985, 0.054), guides)
    assert [c.kind for c in stroke.constraints] == ["at", "on line", "along"]
    assert_allclose(stroke.corners, [[0, 0], [0.1, 0.1 * np.tan(0.5)]], atol=1e-9)


def test_a_typed_length_is_stronger_than_a_guessed_equality():
    stroke = drawn(np.array([[0, 0], [0.05, 0], [0.05, 0.0503], [0, 0.05]]), np.random.default_rng(1), 1e-5)
    assert any(c.kind == "equal" and c.on for c in stroke.constraints)
    for side, length in ((0, 0.05), (1, 0.051)):
        stroke = constrained(stroke, Constraint("length", side, values=(length,)))
    assert_allclose(np.ptp(stroke.corners, axis=0), [0.05, 0.051], atol=1e-9)


def test_undoing_every_click_leaves_nothing():
    stroke = drawn(L, np.random.default_rng(7), 0.0005)
    for left in (6, 5, 4, 3, 2, 1, 0):
        stroke = undone(stroke)
        assert len(stroke.clicks) == left and not stroke.closed
        assert all(c.item < left and c.other < left for c in stroke.constraints)
    with pytest.raises(BadInput, match="no click to take back"):
        undone(stroke)


@pytest.mark.parametrize(
    ("corners", "match"),
    [
        ([[0, 0], [0.1, 0], [0.1, 0.0001]], "corners 2 and 3 of the outline are 0.1 mm apart"),
        ([[0, 0], [0.1, 0.1], [0.1, 0], [0, 0.1]], "crosses itself: side 1 meets side 3"),
        ([[0, 0], [0.1, 0], [0.05, 1e-6]], "encloses 0 mm²"),
    ],
)
def test_outlines_that_enclose_nothing_are_refused(corners, match):
    with pytest.raises(BadInput, match=match):
        sound_corners(Outline(np.array(corners)))


def test_constraints_that_contradict_are_named():
    square = np.array([[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1]])
    asked = (Constraint("horizontal", 0), Constraint("perpendicular", 0, 1), Constraint("along", 1, values=(1.4,)))
    with pytest.raises(BadInput, match=r"contradict one another: .* switch one of them off"):
        _ = Outline(square, asked).corners


@pytest.mark.parametrize(
    "constraint",
    [Constraint("parallel", 0, 9), Constraint("parallel", 1, 1), Constraint("length", 0), Constraint("at", 0, values=(float("nan"), 0.0))],
)
def test_constraints_on_nothing_are_refused(constraint):
    with pytest.raises(BadInput):
        Outline(L, (constraint,))


def test_strokes_refuse_what_cannot_be_drawn():
    stroke = clicked(clicked(Stroke(), (0, 0)), (0.1, 0))
    with pytest.raises(BadInput, match="from a corner"):
        clicked(stroke, (0.1001, 0))
    with pytest.raises(BadInput, match="needs at least 3"):
        closed(stroke)
    with pytest.raises(BadInput, match="still open"):
        _ = stroke.outline
    with pytest.raises(BadInput, match="would cross"):
        clicked(clicked(stroke, (0.1, 0.1)), (0.03, -0.05))
    whole = closed(clicked(stroke, (0.1, 0.1)))
    with pytest.raises(BadInput, match="closed already"):
        clicked(whole, (0, 0))


def test_planes_have_natural_axes():
    T = sketch_plane((0.1, 0.2, 0.3), (0, -2, 0))
    assert_allclose(T[:3, 1], (0, 0, 1), atol=1e-12)
    assert_allclose(T[:3, 2], (0, -1, 0), atol=1e-12)
    assert_allclose(sketch_plane((0, 0, 0.1), (0, 0, 1))[:3, 0], (1, 0, 0), atol=1e-12)
    assert_allclose(sketch_plane((0, 0, 0.1), (0, 0, 1), (0.03, 0.04, 0.1))[:3, 0], (0.6, 0.8, 0), atol=1e-12)
    with pytest.raises(BadInput, match="along the normal"):
        sketch_plane((0, 0, 0), (0, 0, 1), (0, 0, 1))


def test_guides_are_what_lies_in_the_plane():
    T = sketch_plane((0, 0, 0.04), (0, 0, 1))
    segments = [
        [[0, 0, 0.04], [0.1, 0, 0.04]],
        [[0, 0, 0], [0.1, 0.1, 0]],
        [[0, 0, 0], [0, 0, 0.1]],
        [[0, 0.05, 0.041], [0.2, 0.05, 0.041]],
    ]
    guides = guides_in_plane(T, [[0.01, 0.02, 0.0405], [0, 0, 0.1]], segments)
    assert_allclose(guides.points, [[0.01, 0.02]])
    assert len(guides.segments) == 2
    assert_allclose(guides.angles, [0.0, np.pi / 4], atol=1e-9)
