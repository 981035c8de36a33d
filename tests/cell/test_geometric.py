"""The simulated cell: scan, follow, grip, guarded motion, release, and that it refuses what an arm would refuse."""

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.cell.examples import figure1
from handey_studio.cell.geometric import GeometricCell
from handey_studio.cell.protocol import CannotAct, Cell
from handey_studio.cell.workcell import SimulatedSetup, TrueBody, Workcell
from handey_studio.geometry.transforms import from_xyz_rpy, pose_difference, transform
from handey_studio.motion import Trajectory
from handey_studio.world import arm_of
from tests.cell.conftest import OPEN, over_l_block, raised

GRASP_POINT = (0.0147, 0.015, 0.02)  # of the hooked L, in the corner of its foot and leg


def lifted(cell: GeometricCell, arms, name: str = "l_block#2", height: float = 0.12):
    """Grip a standing L from above and lift it; T_world_hand at the grip and the motion that lifted it."""
    T_hand = over_l_block(cell.true_pose(name), GRASP_POINT)
    above = arms.at(raised(T_hand, height), cell.joints())
    down = arms.line(raised(T_hand, height), T_hand, above)
    cell.follow(arms.step("free", [cell.joints(), above], cell.opening()).motion)
    cell.follow(arms.step("approach", down, 0.06).motion)
    cell.grip(0.0)
    up = arms.step("lift", down[::-1], 0.04).motion
    cell.follow(up)
    return T_hand, up


def test_it_is_a_cell_and_says_that_it_has_no_physics(cell):
    used: Cell = cell
    assert used.physics is False
    assert used.scan().elevation.shape == (400, 400)


def test_scans_are_repeatable_by_seed_and_differ_from_one_another(library):
    first, second = (GeometricCell(figure1(), library) for _ in range(2))
    a, b, c = first.scan().elevation, first.scan().elevation, second.scan().elevation
    assert np.array_equal(a, c, equal_nan=True)
    assert not np.array_equal(a, b, equal_nan=True)


def test_a_part_is_gripped_lifted_set_down_and_let_go(cell, arms, robot):
    start = cell.true_pose("l_block#2")
    T_hand, up = lifted(cell, arms)
    assert cell.held_truly() == "l_block#2" and cell.finger_force() > 0
    assert cell.opening() == pytest.approx(0.04, abs=1e-6)
    assert np.allclose(cell.true_pose("l_block#2")[:3, 3] - start[:3, 3], (0, 0, 0.12), atol=1e-6)

    deeper = arms.line(raised(T_hand, 0.12), raised(T_hand, -0.01), up.q_rad[-1], 40)
    moved = cell.descend(arms.step("place", deeper, 0.04).motion)
    assert moved.contact and 0 < moved.time_s < arms.step("place", deeper, 0.04).time_s[-1]
    assert cell.true_pose("l_block#2")[2, 3] - start[2, 3] == pytest.approx(0.0, abs=3e-5)
    assert np.allclose(cell.joints(), moved.q_rad)

    assert cell.grip(robot.hand.opening_max).opening_m == robot.hand.opening_max
    assert cell.held_truly() is None and not cell.finger_force()
    assert pose_difference(cell.true_pose("l_block#2"), start)[0] < 2e-4


def test_a_part_let_go_in_the_air_falls(cell, arms):
    lifted(cell, arms)
    cell.grip(OPEN)
    T = cell.true_pose("l_block#2")
    corners = next(body for body in cell.true_scene() if body.name == "l_block#2").corners_world
    assert corners[:, 2].min() == pytest.approx(0.0, abs=5e-4) or T[2, 3] < 0.12
    assert corners[:, 2].max() < 0.12


def test_what_leaned_on_a_lifted_body_falls(library, arms):
    wall = TrueBody("wall", from_xyz_rpy((0.5, 0.0, 0.04)), size=np.array([0.03, 0.04, 0.08]))
    leaning = TrueBody("leaning", from_xyz_rpy((0.466, 0.0, 0.0345), (0.0, np.deg2rad(20), 0.0)), size=np.array([0.012, 0.03, 0.07]))
    cell = GeometricCell(Workcell(setup=SimulatedSetup((wall, leaning), drop=True)), library)
    assert cell.true_pose("leaning")[2, 2] < 0.99
    T_hand = transform(np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]], float), cell.true_pose("wall")[:3, 3] + (0.0, 0, 0.02))
    above = arms.at(raised(T_hand, 0.1), cell.joints())
    down = arms.line(raised(T_hand, 0.1), T_hand, above)
    cell.follow(arms.step("free", [cell.joints(), above], OPEN).motion)
    cell.follow(arms.step("approach", down, 0.08).motion)
    cell.grip(0.0)
    assert cell.held_truly() == "wall"
    cell.follow(arms.step("lift", down[::-1], 0.04).motion)
    assert cell.true_pose("leaning")[2, 3] < 0.02


def test_a_guarded_motion_without_touch_runs_to_its_end(cell, arms):
    T_hand = arm_of(arms.robot).hand_pose(cell.joints())
    up = arms.line(T_hand, raised(T_hand, 0.05), cell.joints())
    moved = cell.descend(arms.step("place", up, OPEN).motion)
    assert not moved.contact and np.allclose(moved.q_rad, up[-1])


def test_the_bare_hand_feels_the_table(library, arms):
    cell = GeometricCell(Workcell(), library)
    T_hand = transform(np.diag([1.0, -1.0, -1.0]), (0.45, 0.1, 0.05))
    above = arms.at(T_hand, cell.joints())
    cell.follow(arms.step("free", [cell.joints(), above], OPEN).motion)
    moved = cell.descend(arms.step("place", arms.line(T_hand, raised(T_hand, -0.07), above), OPEN).motion)
    assert moved.contact
    assert arm_of(arms.robot).hand_pose(cell.joints())[2, 3] == pytest.approx(0.0, abs=3e-5)


def test_a_grip_on_nothing_reaches_what_was_asked(cell):
    assert cell.grip(0.01).opening_m == 0.01
    assert not cell.finger_force() and cell.held_truly() is None


def test_the_scan_shows_the_arm_and_what_it_holds_where_they_stand_in_its_way(cell, arms, library):
    before = GeometricCell(figure1(), library).scan().elevation
    _, up = lifted(cell, arms)
    after = cell.scan().elevation
    assert np.nanmax(after) > cell.true_pose("l_block#2")[2, 3] > np.nanmax(before)
    cell.follow(arms.step("transfer", [up.q_rad[-1], arms.robot.home], OPEN).motion)
    gone = cell.scan().elevation
    assert (np.nan_to_num(before) - np.nan_to_num(gone) > 0.04).sum() > 1500
    assert (np.nan_to_num(gone) - np.nan_to_num(before) > 0.06).sum() < 20


def test_motions_that_an_arm_could_not_start_are_refused(cell, robot):
    q, times = cell.joints(), np.array([0.0, 1.0])
    opening = np.array([OPEN, OPEN])
    bad = [
        (np.array([q + 0.1, q]), times, opening, "starts 0.100 rad"),
        (np.array([q, np.full(6, 99.0)]), times, opening, "joint limits"),
        (np.array([q, q]), times[::-1], opening, "backwards"),
        (np.array([q, q * np.nan]), times, opening, "finite"),
        (np.array([q[:5], q[:5]]), times, opening, "6 angles"),
    ]
    for angles, at, openings, words in bad:
        with pytest.raises(CannotAct, match=words):
            cell.follow(Trajectory(at, angles, openings))
    with pytest.raises(CannotAct, match="hand opens"):
        cell.grip(0.2)
    assert np.array_equal(cell.joints(), q)


def test_a_setup_that_makes_no_sense_is_refused_in_a_sentence(library):
    body = TrueBody("a", np.eye(4), size=np.array([0.02, 0.02, 0.02]))
    for bodies, words in (
        ((body, body), '"a"'),
        ((TrueBody("a", np.eye(4)),), "size"),
        ((TrueBody("a", np.zeros((4, 4)), size=body.size),), "rigid"),
        ((TrueBody("a", np.eye(4), part="no such part"),), "not known"),
    ):
        with pytest.raises(BadInput, match=words):
            GeometricCell(Workcell(setup=SimulatedSetup(bodies)), library)
    with pytest.raises(BadInput, match="not known"):
        GeometricCell(Workcell(), library).true_pose("nobody")


def test_the_state_now_makes_the_same_cell_again(cell, library, arms):
    lifted(cell, arms)
    cell.grip(OPEN)
    again = GeometricCell(Workcell(setup=cell.setup_now()), library)
    for body in cell.true_scene():
        assert np.array_equal(again.true_pose(body.name), body.T_world_body)
