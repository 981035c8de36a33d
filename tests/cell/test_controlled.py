"""The controller on a driver of its own: what is commanded, when it stops, how it settles. The driver is a perfect arm over soft ground."""

import numpy as np
import pytest

from handey_studio.cell.controlled import ControlledCell
from handey_studio.cell.driver import Drive, Driver, Reference
from handey_studio.cell.protocol import Cell, Compliance
from handey_studio.cell.recorder import Recorder
from handey_studio.cell.reference import course
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.motion import Trajectory
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.world import arm_of

GROUND_N_M = 2e4  # what the soft ground and the wall push back with
SCAN = DepthMap(np.zeros((4, 4)), 0.01, np.eye(4), np.zeros((4, 4)), 1e-3, 1e-3)


class PerfectArm:
    """Does at once what it is told. The ground at z = 0 and a wall at x = `wall_x` push back as springs; `between` is in the fingers."""

    dt = 0.004

    def __init__(self, robot, q, wall_x: float = np.inf, between: float = 0.0) -> None:
        self.arm, self.q, self.wall_x, self.between = arm_of(robot), np.array(q), wall_x, between
        self.velocity, self.opening, self.finger_force = np.zeros_like(self.q), 0.08, 0.0
        self.asked: list[Reference] = []
        self.calls: list[str] = []

    def wrench(self):
        x, _, z = self.arm.hand_pose(self.q)[:3, 3]
        return GROUND_N_M * np.array([-max(0.0, x - self.wall_x), 0.0, max(0.0, -z)]), np.zeros(3)

    def begin(self, call) -> None:
        self.calls.append(call)

    def tick(self, to: Reference, fingers: Drive) -> None:
        self.asked.append(to)
        self.q, self.velocity = to.q, to.velocity
        self.opening = max(fingers.opening, self.between)
        self.finger_force = fingers.force if self.opening > fingers.opening else 0.0


@pytest.fixture
def low(arms, robot) -> np.ndarray:
    """The hand 10 mm above the ground, pointing down."""
    return arms.at(from_xyz_rpy((0.45, 0.1, 0.01), (np.pi, 0.0, 0.0)), robot.home)


def cell_on(driver: Driver, robot) -> Cell:
    return ControlledCell(robot, driver, lambda: SCAN)


def down(arms, q, depth: float, seconds: float) -> Trajectory:
    T = arm_of(arms.robot).hand_pose(q)
    end = np.array(T)
    end[2, 3] -= depth
    path = np.array([q, *arms.line(T, end, q)[1:]])
    return Trajectory(np.linspace(0.0, seconds, len(path)), path, np.full(len(path), 0.08))


def test_a_guarded_motion_commands_to_hold_in_the_tick_after_the_touch(arms, robot, low):
    driver = PerfectArm(robot, low)
    moved = cell_on(driver, robot).descend(down(arms, low, 0.02, 1.0), until_N=4.0)
    heights = np.array([driver.arm.hand_pose(to.q)[2, 3] for to in driver.asked])
    felt = int(np.argmax(-GROUND_N_M * heights >= 4.0))
    assert moved.contact and moved.recording.events[0].time_s == pytest.approx((felt + 1) * driver.dt)
    assert all(np.array_equal(to.q, driver.asked[felt].q) and not to.velocity.any() for to in driver.asked[felt + 1 :])
    assert heights.min() == heights[felt] > -4.0 / GROUND_N_M - 0.02 * driver.dt - 1e-9


def test_without_touch_it_arrives_where_it_was_sent(arms, robot, low):
    driver = PerfectArm(robot, low)
    motion = down(arms, low, 0.005, 0.5)
    moved = cell_on(driver, robot).descend(motion)
    assert moved.ended == "arrived" and np.allclose(moved.q_rad, motion.q_rad[-1]) and not moved.recording.events
    assert driver.calls == ["descend"] and moved.time_s >= 0.5


def test_settling_presses_as_asked_and_gives_way_to_the_side(arms, robot, low):
    x = 0.45
    driver = PerfectArm(robot, low, wall_x=x - 0.0004)  # 8 N from the side
    cell = cell_on(driver, robot)
    cell.descend(down(arms, low, 0.02, 2.0))
    settled = cell.settle(Compliance(force_N=6.0, yield_N=1.0, time_s=3.0))
    force = driver.wrench()[0]
    assert settled.contact and force[2] == pytest.approx(6.0, abs=1.2) and abs(force[0]) < 1.0
    turned = driver.arm.hand_pose(driver.q)[:3, :3].T @ driver.arm.hand_pose(low)[:3, :3]
    assert np.allclose(turned, np.eye(3), atol=1e-3)


def test_settling_in_the_air_goes_no_further_than_allowed(robot, low):
    driver = PerfectArm(robot, low)
    settled = cell_on(driver, robot).settle(Compliance(travel_m=0.001, time_s=3.0))
    sunk = driver.arm.hand_pose(low)[2, 3] - driver.arm.hand_pose(driver.q)[2, 3]
    assert settled.ended == "arrived" and 0.0008 < sunk < 0.0012


def test_fingers_tell_what_stopped_them(robot, low):
    for between, ended in ((0.03, "contact"), (0.0, "arrived")):
        gripped = cell_on(PerfectArm(robot, low, between=between), robot).grip(0.02, 10.0)
        assert gripped.ended == ended and gripped.opening_m == pytest.approx(max(between, 0.02))
        assert gripped.recording.finger_force_N[-1] == (10.0 if between else 0.0)


def test_a_driver_that_falls_behind_is_blocked(arms, robot, low):
    class Stuck(PerfectArm):
        def tick(self, to, fingers) -> None:
            super().tick(to._replace(q=self.q), fingers)

    moved = cell_on(Stuck(robot, low), robot).follow(Trajectory(np.array([0.0, 1.0]), np.array([low, low + 0.2]), np.full(2, 0.08)))
    assert moved.ended == "blocked" and np.allclose(moved.q_rad, low)


def test_the_course_passes_through_the_samples_and_ends_there():
    times = np.linspace(0.0, 0.8, 101)
    q = np.sin(3.0 * times)[:, None] * np.ones(6)
    way = course(Trajectory(times, q, np.linspace(0.0, 0.08, 101)), q[0], 0.002)
    at = np.arange(len(way.q)) * 0.002
    assert np.abs(way.q[:, 0] - np.sin(3.0 * at)).max() < 1e-5
    assert np.abs(way.velocity[2:-2, 0] - 3.0 * np.cos(3.0 * at[2:-2])).max() < 5e-3
    assert np.abs(np.diff(way.q, axis=0) / 0.002 - (way.velocity[1:] + way.velocity[:-1]) / 2).max() < 2e-3
    assert np.allclose(way.speed, 0.1) and np.allclose(way.q[-1], q[-1], atol=1e-12)


def test_a_course_is_led_in_from_where_the_arm_stands():
    q = np.zeros((3, 6))
    way = course(Trajectory(np.array([0.0, 0.1, 0.4]), q, np.zeros(3)), np.full(6, 0.004), 0.002)
    assert np.allclose(way.q[0], 0.004) and np.allclose(way.q[60:], 0.0)
    assert course(Trajectory(np.zeros(1), q[:1], np.zeros(1)), q[0], 0.002).q.shape == (2, 6)


def test_no_more_than_125_samples_a_second_are_kept(robot, low):
    driver = PerfectArm(robot, low)
    recorder = Recorder(driver)
    for _ in range(101):
        recorder.sample(low)
    kept = recorder.recording(low)
    assert len(kept.time_s) == 51 and kept.time_s[-1] == pytest.approx(101 * driver.dt)
