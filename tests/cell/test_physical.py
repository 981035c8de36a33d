"""The cell with forces: friction grips, weights are felt, guarded motions stop, faults do what they say, and all of it twice the same."""

import json
import threading
from dataclasses import replace

import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.base.coding import from_plain, to_plain
from handey_studio.cell import CannotAct, Cell, Fault, joined, tracking_error
from handey_studio.cell.examples import figure1
from handey_studio.cell.physics.physical import PhysicalCell
from handey_studio.cell.simulated import simulated_cell
from handey_studio.cell.workcell import SimulatedSetup, TrueBody, Workcell
from handey_studio.geometry.transforms import from_xyz_rpy, inverse, pose_difference, transform
from handey_studio.motion import PathResult, Trajectory, time_path
from handey_studio.sensing.stripes.range_finder import RangeFinder
from handey_studio.world import arm_of
from handey_studio.world.world import Block
from tests.cell.conftest import AHEAD, Arms, raised

BLOCK = np.array([0.05, 0.04, 0.06])
WEIGHT_N = 700.0 * BLOCK.prod() * 9.81
START = from_xyz_rpy((0.45, 0.1, 0.03))
HOVER = 0.06
TURNED = np.diag([-1.0, -1.0, 1.0, 1.0])


def cell_with(library, *faults, bodies=(TrueBody("block", START, size=BLOCK),), blocks=(), **setup) -> PhysicalCell:
    setup = SimulatedSetup(bodies, physics=True, faults=faults, **setup)
    cell = simulated_cell(Workcell(blocks=blocks, finder=RangeFinder(planes=200, cell=0.004, area=(0.1, 0.1)), setup=setup), library)
    assert isinstance(cell, PhysicalCell)
    return cell


def gentle(q, seconds: float, opening: float) -> Trajectory:
    """Along configurations (n, joints) from rest to rest, the fingers as they are."""
    share = np.linspace(0.0, 1.0, max(2, int(seconds / 0.008)))
    eased = share**3 * (10.0 - 15.0 * share + 6.0 * share**2) * (len(q) - 1)
    path = np.array([np.interp(eased, np.arange(len(q)), column) for column in np.transpose(q)]).T
    return Trajectory(share * seconds, path, np.full(len(share), opening))


def over(T_world_body) -> np.ndarray:
    """A hand that points down and closes along the block's y, its tips at the block's middle."""
    x, down = T_world_body[:3, 1], np.array([0.0, 0.0, -1.0])
    return transform(np.stack([x, np.cross(down, x), down], axis=1), T_world_body[:3, 3])


class Hands:
    """Moves of a cell's arm, each kept."""

    def __init__(self, cell: PhysicalCell, arms: Arms) -> None:
        self.cell, self.arms, self.moves = cell, arms, []
        self._to(AHEAD, cell.opening())

    def go(self, T_world_hand, opening: float = 0.06):
        """By the joints, as quick as the robot's limits allow; the hand looks the same with its fingers swapped."""
        now = self.cell.joints()
        ways = [self.arms.at(T_world_hand @ turn, now) for turn in (np.eye(4), TURNED)]
        return self._to(min(ways, key=lambda q: np.abs(q - now).max()), opening)

    def _to(self, q, opening: float):
        way = PathResult("found", "", np.array([self.cell.joints(), q]))
        return self._keep(self.cell.follow(time_path(self.arms.robot, way, opening)))

    def straight(self, T_world_hand, seconds: float, guarded: bool = False, opening: float = 0.06):
        start = arm_of(self.arms.robot).hand_pose(self.cell.joints())
        T_world_hand = transform(start[:3, :3], T_world_hand[:3, 3])
        path = [self.cell.joints(), *self.arms.line(start, T_world_hand, self.cell.joints())[1:]]
        motion = gentle(np.array(path), seconds, opening)
        return self._keep(self.cell.descend(motion) if guarded else self.cell.follow(motion))

    def grip(self, opening: float, force_N: float | None = None):
        return self._keep(self.cell.grip(opening, force_N))

    def take(self, force_N: float | None = None):
        """Grip the block from above; how the grip ended."""
        grasp = over(START)
        self.go(raised(grasp, HOVER))
        self.straight(grasp, 0.8)
        return self.grip(BLOCK[1] - 0.002, force_N)

    def lift(self):
        return self.straight(raised(over(START), HOVER), 0.8)

    def _keep(self, moved):
        self.moves.append(moved)
        return moved

    def T_hand_block(self):
        return inverse(arm_of(self.arms.robot).hand_pose(self.cell.joints())) @ self.cell.true_pose("block")


@pytest.fixture
def hands(library, arms) -> Hands:
    return Hands(cell_with(library), arms)


def test_a_block_is_held_by_friction_alone_and_does_not_creep(hands):
    used: Cell = hands.cell
    assert used.physics and hands.cell.held_truly() is None
    gripped = hands.take()
    assert gripped.contact and gripped.opening_m == pytest.approx(BLOCK[1], abs=2e-4)
    assert set(hands.cell.touched_truly()) == {("finger_left", "block"), ("finger_right", "block")}
    assert hands.cell.held_truly() == "block" and hands.cell.finger_force() == pytest.approx(hands.arms.robot.hand.force)
    hands.lift()
    assert hands.cell.wrench().force_N == pytest.approx((0, 0, -WEIGHT_N), abs=0.05)
    before = hands.T_hand_block()
    hands.go(from_xyz_rpy((0.3, 0.35, 0.2), (np.pi, 0.2, 1.5)))
    metres, radians = pose_difference(hands.T_hand_block(), before)
    assert metres < 1e-4 and radians < np.deg2rad(0.1)


def test_a_grip_holds_just_as_long_as_friction_can(library, arms):
    """Two pads of friction 0.5 carry the weight from a force of the weight on."""
    for force, holds in ((0.7 * WEIGHT_N, False), (1.5 * WEIGHT_N, True)):
        hands = Hands(cell_with(library), arms)
        hands.take(force)
        hands.lift()
        assert (hands.cell.true_pose("block")[2, 3] > START[2, 3] + 0.9 * HOVER) == holds


def test_the_wrist_feels_the_lever_of_what_is_held_off_its_middle(hands):
    aside = transform(None, (0.015, 0.0, 0.0)) @ over(START)
    hands.go(raised(aside, HOVER))
    hands.straight(aside, 0.8)
    hands.grip(BLOCK[1] - 0.002)
    hands.straight(raised(aside, HOVER), 0.8)
    wrench = hands.cell.wrench()
    lever = hands.cell.true_pose("block")[:3, 3] - arm_of(hands.arms.robot).hand_pose(hands.cell.joints())[:3, 3]
    assert lever[0] == pytest.approx(-0.015, abs=3e-4)
    assert wrench.torque_Nm == pytest.approx(np.cross(lever, (0.0, 0.0, -WEIGHT_N)), abs=1e-3)


def test_what_is_put_down_by_force_stands_where_it_was(hands):
    hands.take()
    hands.lift()
    moved = hands.straight(raised(over(START), -0.01), 4.0, guarded=True)
    touch = moved.recording.events[-1]
    assert moved.contact and touch.what == "contact" and touch.force_N > 4.0
    low = arm_of(hands.arms.robot).hand_pose(moved.recording.q_rad)[:, 2, 3]
    assert low[-1] - START[2, 3] == pytest.approx(0.0, abs=3e-4)
    assert np.abs(moved.recording.force_N).max() < 50.0
    settled = hands.cell.settle()
    assert settled.contact and hands.cell.wrench().force_N[2] == pytest.approx(5.0, abs=1.2)
    hands.grip(0.06)
    hands.straight(raised(over(START), HOVER), 0.8)
    metres, radians = pose_difference(hands.cell.true_pose("block"), START)
    assert metres < 5e-4 and radians < np.deg2rad(0.2) and hands.cell.held_truly() is None


def test_a_settling_arm_gives_way_sideways(library, arms):
    """The block is pushed against a wall's side; settling takes the force off."""
    wall = Block("wall", np.array([0.06, 0.3, 0.05]), from_xyz_rpy((0.506, 0.1, 0.025)))
    hands = Hands(cell_with(library, blocks=(wall,)), arms)
    hands.take()
    hands.straight(raised(over(START), 0.002), 0.3)
    pressed = hands.straight(transform(None, (0.0015, 0.0, 0.0)) @ raised(over(START), 0.002), 0.4)
    assert np.abs(pressed.recording.force_N[-1, 0]) > 2.0
    assert np.linalg.norm(hands.cell.settle().recording.force_N[-1, :2]) < 1.5


def test_the_arm_tracks_what_it_is_told_to_a_tenth_of_a_millimetre(hands):
    moved = hands.go(from_xyz_rpy((0.3, 0.35, 0.3), (np.pi, 0.2, 1.5)))
    error = tracking_error(moved.recording, arm_of(hands.arms.robot))
    assert 0.0 < error.joint_rad < 3e-4 and 0.0 < error.hand_mm < 0.1
    assert np.diff(moved.recording.time_s).max() == pytest.approx(0.008)
    twice = joined([moved.recording, moved.recording])
    assert (np.diff(twice.time_s) >= 0).all() and twice.time_s[-1] == pytest.approx(2 * moved.time_s)


@pytest.mark.parametrize("name", ["puma560", "panda", "xarm7", "ur3", "ur10"])
def test_every_arm_of_the_library_is_held_on_its_way(library, name):
    robot = library.robot(name)
    cell = simulated_cell(Workcell(robot=name), library)
    aside = robot.home + 0.2 * np.where(np.arange(len(robot.home)) % 2, 1.0, -1.0)
    moved = cell.follow(time_path(robot, PathResult("found", "", np.array([robot.home, aside])), robot.hand.opening_max))
    assert moved.ended == "arrived" and tracking_error(moved.recording, arm_of(robot)).joint_rad < 5e-4
    closed = cell.grip(robot.hand.opening_min)
    assert closed.ended == "arrived" and closed.opening_m == pytest.approx(robot.hand.opening_min, abs=1e-4)


def test_the_bare_hand_stops_on_the_table_within_a_millimetre(library, arms):
    hands = Hands(cell_with(library, bodies=()), arms)
    hands.go(raised(over(START), 0.03), opening=0.03)
    moved = hands.straight(raised(over(START), -0.1), 1.5, guarded=True)  # meets the table at 80 mm/s
    arm, event = arm_of(arms.robot), moved.recording.events[-1]
    assert moved.contact
    heights = arm.hand_pose(moved.recording.q_rad)[:, 2, 3]
    at_touch = heights[np.searchsorted(moved.recording.time_s, event.time_s) - 1]
    assert at_touch - heights.min() < 1e-3 and heights.min() > -1e-3


def test_the_same_calls_give_the_same_numbers(library, arms):
    runs = []
    for _ in range(2):
        hands = Hands(cell_with(library), arms)
        hands.take()
        hands.lift()
        runs.append(joined([moved.recording for moved in hands.moves]))
    assert runs[0] == runs[1]


def test_it_starts_with_what_the_setup_says_is_in_the_hand(library, arms):
    T_hand = arm_of(arms.robot).hand_pose(arms.robot.home)
    held = TrueBody("cube", T_hand @ transform(None, (0.0, 0.0, 0.01)), size=np.full(3, 0.04))
    hands = Hands(cell_with(library, bodies=(held,), held="cube"), arms)
    hands.straight(raised(T_hand, 0.05), 1.0)
    assert hands.cell.held_truly() == "cube"
    now = inverse(arm_of(arms.robot).hand_pose(hands.cell.joints())) @ hands.cell.true_pose("cube")
    assert pose_difference(now, inverse(T_hand) @ held.T_world_body)[0] < 2e-4


def test_stop_ends_a_motion_and_the_arm_stands(hands):
    threading.Timer(0.01, hands.cell.stop).start()
    q = hands.cell.joints()
    moved = hands.cell.follow(gentle([q, q + np.array([2.0, 0, 0, 0, 0, 0])], 60.0, 0.09))
    assert moved.ended == "stopped" and moved.time_s < 59.0
    assert np.abs(hands.cell.joints() - moved.q_rad).max() < 1e-9
    assert hands.go(arm_of(hands.arms.robot).hand_pose(hands.cell.joints())).ended == "arrived"


def test_without_friction_the_block_slips_out(library, arms):
    hands = Hands(cell_with(library, Fault("slip", "follow", count=4, time_s=0.3, size=0.005)), arms)
    assert hands.take().contact
    lifted = hands.lift()
    assert hands.cell.held_truly() is None and hands.cell.true_pose("block")[2, 3] < 0.04
    assert lifted.opening_m < BLOCK[1] - 0.001
    assert np.abs(hands.cell.wrench().force_N).max() < 0.05


def test_a_push_shoves_a_body_as_far_as_newton_says(library, robot):
    cell = cell_with(library, Fault("push", "follow", lasts_s=0.1, vector=np.array([0.0, 1.2, 0.0]), body="block"))
    still = Trajectory(np.array([0.0, 1.0]), np.array([robot.home, robot.home]), np.full(2, 0.09))
    cell.follow(still)
    moved = cell.true_pose("block")[:3, 3] - START[:3, 3]
    held_back = 0.5 * 9.81  # by friction
    speed = 0.1 * (1.2 / (WEIGHT_N / 9.81) - held_back)
    assert moved[1] == pytest.approx(0.05 * speed + speed**2 / (2 * held_back), rel=0.1) and abs(moved[0]) < 0.002
    cell.follow(still)
    assert np.allclose(cell.true_pose("block")[:3, 3] - START[:3, 3], moved, atol=1e-4)


def test_an_obstacle_that_no_scan_showed_blocks_the_arm(library, arms):
    here = raised(over(START), 0.15)
    fault = Fault("obstacle", "scan", vector=np.array([0.02, 0.3, 0.4]), T_world_body=from_xyz_rpy((0.38, 0.1, 0.2)))
    hands = Hands(cell_with(library, fault), arms)
    hands.go(here)
    assert "obstacle1" not in [body.name for body in hands.cell.true_scene()]
    hands.cell.scan()
    hands.cell.settle()
    moved = hands.straight(transform(None, (-0.15, 0.0, 0.0)) @ here, 1.0)
    assert moved.ended == "blocked" and moved.recording.events[-1].what == "blocked"
    assert any(body == "obstacle1" for _, body in hands.cell.touched_truly())
    assert "obstacle1" in [body.name for body in hands.cell.true_scene()]


def test_a_biased_scan_is_shifted_once(library):
    cell = cell_with(library, Fault("bias", "scan", lasts_s=0.0, vector=np.array([0.004, 0.0, 0.002])))
    plain = cell_with(library).scan()
    first, second = cell.scan(), cell.scan()
    assert np.allclose(first.T_world_range[:3, 3] - plain.T_world_range[:3, 3], (0.004, 0.0, 0.002))
    assert np.array_equal(second.T_world_range, plain.T_world_range)
    assert np.array_equal(first.elevation, plain.elevation, equal_nan=True)


def test_fingers_that_stick_stop_wide(library, arms):
    hands = Hands(cell_with(library, Fault("stuck", "grip", size=0.05)), arms)
    stuck = hands.take()
    assert stuck.contact and stuck.opening_m == pytest.approx(0.05, abs=5e-4)
    assert hands.cell.held_truly() is None


def test_a_jammed_joint_blocks_the_arm(library, robot):
    cell = cell_with(library, Fault("blocked", "follow", time_s=0.3, size=1), bodies=())
    aside = robot.home + np.array([0.3, 0.4, 0, 0, 0, 0])
    moved = cell.follow(gentle([robot.home, aside], 1.0, 0.09))
    assert moved.ended == "blocked" and 0.3 < moved.time_s < 1.0
    assert abs(cell.joints()[1] - robot.home[1]) < 0.3


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (Fault("push", "scan", body="nobody"), "nobody"),
        (Fault("obstacle", "scan"), "sides above 0"),
        (Fault("blocked", "follow", size=6.0), "joints 0 to 5"),
        (Fault("slip", "follow", time_s=np.nan), "finite"),
        (Fault("slip", "follow", count=0), "count"),
    ],
)
def test_faults_that_cannot_be_are_refused_in_a_sentence(library, fault, words):
    with pytest.raises(BadInput, match=words):
        cell_with(library, fault)


def test_a_setup_comes_back_from_a_file_as_it_was(library):
    setup = SimulatedSetup((TrueBody("block", START, size=BLOCK),), faults=(Fault("push", "grip", vector=np.ones(3)),), held="block")
    assert from_plain(json.loads(json.dumps(to_plain(setup))), SimulatedSetup) == setup
    with pytest.raises(BadInput, match="not known"):
        cell_with(library, held="nobody")


def test_it_refuses_what_an_arm_would_refuse(hands):
    with pytest.raises(CannotAct, match=r"starts 0\.100 rad"):
        hands.cell.follow(gentle([AHEAD + 0.1, AHEAD], 1.0, 0.09))
    with pytest.raises(CannotAct, match="hand opens"):
        hands.cell.grip(0.2)


def test_the_piles_of_figure_1_stay_where_they_lie(library):
    workcell = figure1()
    cell = simulated_cell(replace(workcell, setup=replace(workcell.setup, physics=True)), library)
    before = {body.name: body.T_world_body for body in cell.true_scene()}
    q = cell.joints()
    cell.follow(Trajectory(np.array([0.0, 3.0]), np.array([q, q]), np.full(2, 0.09)))
    moved = [pose_difference(before[body.name], body.T_world_body) for body in cell.true_scene()]
    assert max(metres for metres, _ in moved) < 2e-4 and max(radians for _, radians in moved) < np.deg2rad(0.3)
