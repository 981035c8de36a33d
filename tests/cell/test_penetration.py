"""Overlap of convex bodies by separating axes, against linear programming and by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.check.penetration import overlap, polytope
from handey_studio.geometry import box
from handey_studio.geometry.transforms import apply, from_xyz_rpy, transform
from tests.cell.overlaps import body_overlap

HALF = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def share_a_point(a: np.ndarray, b: np.ndarray) -> float:
    """Naive oracle: the radius of the greatest ball that fits into both hulls, negative when there is none."""
    planes = np.concatenate([ConvexHull(a).equations, ConvexHull(b).equations])
    found = linprog((0, 0, 0, -1), A_ub=np.c_[planes[:, :3], np.ones(len(planes))], b_ub=-planes[:, 3], bounds=[(None, None)] * 4)
    return -found.fun


@given(st.integers(0, 10**6))
def test_polytopes_overlap_exactly_when_a_ball_fits_into_both(seed):
    rng = np.random.default_rng(seed)
    a, b = (rng.normal(size=(rng.integers(4, 10), 3)) * rng.uniform(0.2, 1.0, 3) for _ in range(2))
    T_a = transform(Rotation.random(rng=rng).as_matrix(), rng.normal(0, 0.8, 3))
    T_b = transform(Rotation.random(rng=rng).as_matrix(), rng.normal(0, 0.8, 3))
    deep = overlap(polytope(a), T_a, polytope(b), T_b)
    ball = share_a_point(apply(T_a, a), apply(T_b, b))
    assert (deep > 0) == (ball > 0) or abs(ball) < 1e-7
    assert ball <= 0 or deep >= 2 * ball - 1e-9  # whatever holds a ball is at least as deep as the ball is wide
    assert overlap(polytope(b), T_b, polytope(a), T_a) == pytest.approx(deep, abs=1e-12)


@given(st.floats(-0.3, 0.3), st.floats(-0.5, 0.5), st.floats(-3, 3))
def test_a_cube_on_a_cube_is_as_deep_as_it_was_pushed(deep, across, yaw):
    other = from_xyz_rpy((across, 0.1, 1.0 - deep), (0, 0, yaw))
    assert overlap(polytope(HALF), np.eye(4), polytope(HALF), other) == pytest.approx(deep, abs=1e-12)


def test_crossed_edges_separate_where_no_face_does():
    turned = from_xyz_rpy((0, 0, 0), (np.pi / 4, 0, 0))
    crossed = from_xyz_rpy((0, 0, np.sqrt(2) + 0.01), (0, np.pi / 4, 0))
    assert overlap(polytope(HALF), turned, polytope(HALF), crossed) == pytest.approx(-0.01, abs=1e-9)


def test_concave_bodies_meet_only_where_they_are_solid(library):
    part = library.part("l_block")
    ell = SolidBody("ell", part.solid, np.eye(4))
    in_notch = SolidBody("peg", box((0.02, 0.02, 0.02)), transform(None, (0.045, 0.045, 0.02)))
    in_foot = SolidBody("peg", box((0.02, 0.02, 0.02)), transform(None, (0.045, 0.030, 0.02)))
    assert body_overlap(ell, in_notch) < 0
    assert body_overlap(ell, in_foot) == pytest.approx(0.0095, abs=1e-9)
