"""What the fingers close on, and how it ends up in the hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.cell.bodies import SolidBody, fixed_bodies
from handey_studio.cell.gripping import close_fingers, span_between
from handey_studio.cell.workcell import Workcell
from handey_studio.geometry import box
from handey_studio.geometry.transforms import apply, from_xyz_rpy, transform

DOWN = transform(np.diag([1.0, -1.0, -1.0]), (0.5, 0.0, 0.02))  # a hand that points down, its tips 20 mm above the table
TABLE = fixed_bodies(Workcell())


def block(width: float, x: float = 0.0, yaw: float = 0.0, name: str = "block") -> SolidBody:
    """A block of 40 × 40 mm height and length that stands between the fingers."""
    return SolidBody(name, box((width, 0.04, 0.08)), from_xyz_rpy((0.5 + x, 0.0, 0.04), (0, 0, yaw)))


@given(width=st.floats(0.01, 0.09), x=st.floats(-0.004, 0.004))
@settings(max_examples=25, deadline=None)
def test_the_fingers_close_on_the_true_width_and_centre_the_body(robot, width, x):
    grip = close_fingers(robot.hand, DOWN, [*TABLE, block(width, x)], 0.1, 0.0)
    assert grip.held == "block" and grip.T_hand_body is not None
    assert grip.opening == pytest.approx(width, abs=1e-9)
    assert grip.T_hand_body[0, 3] == pytest.approx(0.0, abs=1e-9)


@given(yaw_deg=st.floats(-4.5, 4.5))
@settings(max_examples=15, deadline=None)
def test_a_body_that_is_a_little_askew_turns_flat_against_the_fingers(robot, yaw_deg):
    grip = close_fingers(robot.hand, DOWN, [block(0.05, 0.002, np.deg2rad(yaw_deg))], 0.1, 0.0)
    assert grip.opening == pytest.approx(0.05, abs=1e-9)
    assert np.abs(grip.T_hand_body[0, :3]).max() == pytest.approx(1.0, abs=1e-12)


def test_a_body_far_askew_is_held_by_its_edges(robot):
    grip = close_fingers(robot.hand, DOWN, [block(0.05, 0.0, np.deg2rad(20))], 0.1, 0.0)
    assert grip.held == "block"
    assert grip.opening > 0.05 and np.abs(grip.T_hand_body[0, :3]).max() == pytest.approx(np.cos(np.deg2rad(20)))


def test_nothing_between_closes_to_what_was_asked(robot):
    beside = block(0.03, 0.2)
    below = SolidBody("plate", box((0.08, 0.08, 0.018)), transform(None, (0.5, 0, 0.009)))
    grip = close_fingers(robot.hand, DOWN, [*TABLE, beside, below], 0.1, 0.012)
    assert grip.opening == 0.012 and grip.held is None


def test_a_hand_that_stops_wider_than_the_body_does_not_hold_it(robot):
    assert close_fingers(robot.hand, DOWN, [block(0.03)], 0.1, 0.035).held is None
    assert close_fingers(robot.hand, DOWN, [block(0.03)], 0.1, 0.03).held == "block"


def test_fixed_bodies_keep_the_fingers_apart_and_are_not_held(robot):
    low = DOWN.copy()
    low[2, 3] = -0.005
    grip = close_fingers(robot.hand, low, TABLE, 0.1, 0.0)
    assert grip.held is None and grip.opening == pytest.approx(0.1)


def test_of_two_bodies_the_wider_one_is_held(robot):
    grip = close_fingers(robot.hand, DOWN, [block(0.02, -0.025, name="thin"), block(0.04, 0.02, name="thick")], 0.1, 0.0)
    assert grip.held == "thick"
    assert grip.opening == pytest.approx(0.075, abs=1e-9)


def test_only_what_is_between_the_fingers_counts(robot, library):
    """Over the foot of an L whose leg stands beside the fingers, the span is the foot's, not the part's."""
    solid = library.part("l_block").solid
    upright = from_xyz_rpy((0.455, 0.020, 0.0), (np.pi / 2, 0, 0))
    ell = SolidBody("ell", solid, upright)
    across = transform(np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]], float).T, (0.505, 0.0, 0.01))
    low, high = span_between(robot.hand, np.linalg.inv(across) @ upright, ell, 0.1)
    inside = apply(np.linalg.inv(across) @ upright, solid.vertices)
    assert (low, high) == pytest.approx((-0.02, 0.02), abs=1e-9)
    assert np.ptp(inside[:, 1]) > robot.hand.finger_width
