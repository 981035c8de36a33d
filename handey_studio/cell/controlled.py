"""The protocol's motions on a driver: trajectories tracked, guarded by what the wrist feels, settling that yields, grips by force."""

import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.driver import Drive, Driver, Reference
from handey_studio.cell.faults import Call
from handey_studio.cell.motions import check_motion, check_opening
from handey_studio.cell.protocol import TOUCH_N, Compliance, Ending, Moved, Wrench
from handey_studio.cell.recorder import Recorder
from handey_studio.cell.reference import Course, course
from handey_studio.motion import Trajectory
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.world.arm import Arm, arm_of
from handey_studio.world.robot import Robot

BLOCKED_RAD = 0.02  # a joint this far behind its command is hindered
BLOCKED_N = 100.0  # and so is an arm whose hand meets this much
FINGER_SPEED = 0.05  # m/s at which the opening changes
GRIP_M, GRIP_SPEED = 2e-4, 1e-3  # fingers this near to where they go [m], or this slow on what stops them [m/s], are done
GRIP_S = 0.04  # for which they must be so
PRESSED = 0.95  # share of the drive's force from which fingers press on something
LATE_S = 1.0  # longer than its way takes no grip lasts
REST_S, REST_RAD, REST_RAD_S = 0.12, 1e-4, 1e-3  # after a motion the arm comes to rest
YIELD_GAIN = 4e-4  # m/s for each newton: a settling arm gives way no faster, or it would tremble on stiff ground
YIELD_SPEED = 0.005  # m/s at most
SETTLED_SHARE, SETTLED_S = 0.2, 0.02  # pressed within this share of what is asked, for so long


class ControlledCell:
    """A cell made of a robot, a driver that moves it, and a function that scans. Not a value: it moves things.

    A guarded motion looks at the wrist after every tick, and commands the arm to hold where it is in the tick after the one that felt
    the touch: its reaction time is two ticks. How far the arm still goes is the drive's own stopping distance.
    """

    physics = True

    def __init__(self, robot: Robot, driver: Driver, scan: Callable[[], DepthMap]) -> None:
        self._robot, self._driver, self._scan = robot, driver, scan
        self._halt = threading.Event()
        self._hold = np.array(driver.q)
        self._drive = Drive(driver.opening, 0.0, robot.hand.force)
        self._gripping = driver.finger_force > 0

    def scan(self) -> DepthMap:
        self._begin("scan")
        return self._scan()

    def joints(self) -> NDArray:
        return np.array(self._driver.q)

    def opening(self) -> float:
        return self._driver.opening

    def wrench(self) -> Wrench:
        return Wrench(*self._driver.wrench())

    def finger_force(self) -> float:
        return self._driver.finger_force

    def stop(self) -> None:
        self._halt.set()

    def follow(self, motion: Trajectory) -> Moved:
        check_motion(motion, self._robot, self._driver.q)
        self._begin("follow")
        return self._run(course(motion, self._hold, self._driver.dt), np.inf)

    def descend(self, motion: Trajectory, until_N: float = TOUCH_N) -> Moved:
        check_motion(motion, self._robot, self._driver.q)
        self._begin("descend")
        return self._run(course(motion, self._hold, self._driver.dt), until_N)

    def settle(self, compliance: Compliance = Compliance()) -> Moved:
        self._begin("settle")
        recorder, arm = Recorder(self._driver), arm_of(self._robot)
        back = np.linalg.pinv(_jacobian(arm, self._driver.q), rcond=1e-4)[:, :3]
        start, calm = arm.hand_pose(self._driver.q)[:3, 3], 0
        ending: Ending = "arrived"
        for _ in range(self._ticks(compliance.time_s)):
            force = self._driver.wrench()[0]
            free = bool(np.linalg.norm(force[:2]) < compliance.yield_N)
            calm = calm + 1 if free and abs(force[2] - compliance.force_N) < SETTLED_SHARE * compliance.force_N else 0
            if self._halt.is_set() or calm >= self._ticks(SETTLED_S):
                ending = "stopped" if self._halt.is_set() else "contact"
                break
            if np.abs(arm.hand_pose(self._hold)[:3, 3] - start).max() > compliance.travel_m:
                break
            push = np.array([*(force[:2] * (not free)), force[2] - compliance.force_N])
            rates = back @ np.clip(YIELD_GAIN * push, -YIELD_SPEED, YIELD_SPEED)
            self._hold = self._hold + rates * self._driver.dt
            self._tick(Reference(self._hold, rates, np.zeros_like(rates)), recorder)
        return self._rested(ending, recorder)

    def grip(self, opening: float, force_N: float | None = None) -> Moved:
        check_opening(self._robot.hand, opening)
        self._begin("grip")
        recorder, driver = Recorder(self._driver), self._driver
        limit = self._robot.hand.force if force_N is None else min(force_N, self._robot.hand.force)
        start, calm, there = driver.opening, 0, False
        way = np.linspace(start, opening, self._ticks(abs(opening - start) / FINGER_SPEED) + 1)
        speed = float(np.sign(opening - start)) * FINGER_SPEED
        for k in range(len(way) + self._ticks(LATE_S)):
            arrived = k >= len(way)
            self._drive = Drive(opening if arrived else float(way[k]), 0.0 if arrived else speed, limit)
            before = driver.opening
            self._tick(self._standing(), recorder)
            slow, there = abs(driver.opening - before) < GRIP_SPEED * driver.dt, abs(driver.opening - opening) < GRIP_M
            calm = calm + 1 if slow and (there or abs(driver.finger_force) >= PRESSED * limit) else 0
            if calm >= self._ticks(GRIP_S) or self._halt.is_set():
                break
        ending: Ending = "stopped" if self._halt.is_set() else "arrived" if there else "contact"
        self._gripping = ending == "contact" and opening < start
        self._drive = Drive(driver.opening if ending == "stopped" else opening, 0.0, limit)
        return self._rested(ending, recorder)

    def _begin(self, call: Call) -> None:
        self._halt.clear()
        self._driver.begin(call)

    def _ticks(self, seconds: float) -> int:
        return int(np.ceil(seconds / self._driver.dt))

    def _run(self, way: Course, until_N: float) -> Moved:
        """Follow until the end, or until the wrist's force has changed by `until_N`, something hinders the arm, or it is stopped."""
        recorder, before = Recorder(self._driver), self._driver.wrench()[0]
        for k in range(1, len(way.q)):
            if not self._gripping:
                self._drive = Drive(float(way.opening[k]), float(way.speed[k]), self._drive.force)
            self._hold = way.q[k]
            self._tick(Reference(way.q[k], way.velocity[k], way.acceleration[k]), recorder)
            ended = self._ended(before, until_N)
            if ended is not None:
                recorder.event(ended)
                self._hold = np.array(self._driver.q)
                return self._rested(ended, recorder)
        return self._rested("arrived", recorder)

    def _ended(self, before: NDArray, until_N: float) -> Ending | None:
        """Why a motion ends now, if it does; `before` (3,) [N] is what the wrist felt at its start."""
        force = self._driver.wrench()[0]
        if self._halt.is_set():
            return "stopped"
        if np.linalg.norm(force - before) >= until_N:
            return "contact"
        hindered = np.abs(self._hold - self._driver.q).max() > BLOCKED_RAD or np.linalg.norm(force) > BLOCKED_N
        return "blocked" if hindered else None

    def _rested(self, ending: Ending, recorder: Recorder) -> Moved:
        """Hold until the arm stands still."""
        for _ in range(self._ticks(REST_S)):
            self._tick(self._standing(), recorder)
            if np.abs(self._driver.velocity).max() < REST_RAD_S and np.abs(self._hold - self._driver.q).max() < REST_RAD:
                break
        return Moved(ending, recorder.recording(self._hold))

    def _standing(self) -> Reference:
        still = np.zeros_like(self._hold)
        return Reference(self._hold, still, still)

    def _tick(self, to: Reference, recorder: Recorder) -> None:
        self._driver.tick(to, self._drive)
        recorder.sample(to.q)


def _jacobian(arm: Arm, q: NDArray) -> NDArray:
    """(6, joints): how fast the hand's origin moves [m] and the hand turns [rad] in the world for each joint's rate."""
    links = arm.link_poses(q)
    axes = np.einsum("nij,nj->ni", links[1:, :3, :3], arm.axes)
    levers = arm.hand_pose(q)[:3, 3] - links[1:, :3, 3]
    return np.concatenate([np.cross(axes, levers), axes], axis=1).T
