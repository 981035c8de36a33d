"""The simulated cell with forces: arm and hand under control, parts that fall, slip and tip, grips by friction alone."""

import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.fault_clock import FaultClock
from handey_studio.cell.faults import Call, Fault
from handey_studio.cell.gripping import span_between
from handey_studio.cell.motions import check_motion, check_opening
from handey_studio.cell.protocol import TOUCH_N, Compliance, Ending, Moved, Wrench
from handey_studio.cell.recorder import Recorder
from handey_studio.cell.reference import Course, course
from handey_studio.cell.simulation import Drive, Reference, Simulation
from handey_studio.cell.truth import TrueState, obstacles, true_bodies
from handey_studio.cell.workcell import Workcell
from handey_studio.geometry.transforms import inverse
from handey_studio.motion import Trajectory
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.world.library import Library

BLOCKED_RAD = 0.02  # a joint this far behind its command is hindered
BLOCKED_N = 100.0  # and so is an arm whose hand meets this much
FINGER_SPEED = 0.05  # m/s at which the opening changes
GRIP_M, GRIP_SPEED = 2e-4, 1e-3  # fingers this near to where they go [m], or this slow on what stops them [m/s], are done
GRIP_STEPS = 20  # for which they must be so
PRESSED = 0.95  # share of the drive's force from which fingers press on something
LATE_S = 1.0  # longer than its way takes no grip lasts
REST_STEPS, REST_RAD, REST_RAD_S = 60, 1e-4, 1e-3  # after a motion the arm comes to rest
CALM_S, CALM_SPEED, CALM_TURN = 2.0, 0.002, 0.05  # before a scan, bodies do
YIELD_GAIN = 4e-4  # m/s for each newton: a settling arm gives way no faster, or it would tremble on stiff ground
YIELD_SPEED = 0.005  # m/s at most
SETTLED_SHARE, SETTLED_STEPS = 0.2, 10  # pressed within this share of what is asked, for so long

Watch = Callable[[], Ending | None]


class PhysicalCell(TrueState):
    """A simulated cell in which everything obeys forces. Deterministic: the same calls on the same setup give the same numbers.

    Time passes in motions, and before a scan until the bodies are at rest. The controller looks at the wrist every 2 ms; a guarded motion
    holds where the arm is in the step after the one that felt the touch.
    """

    physics = True

    def __init__(self, workcell: Workcell, library: Library) -> None:
        super().__init__(workcell, library)
        bodies = true_bodies(workcell, library)
        self._obstacles = obstacles(self._setup.faults)
        self._sim = Simulation(self._arm, bodies, self._obstacles)
        self._clock, self._now = FaultClock(self._setup.faults), 0.0
        self._there: set[int] = set()
        self._pushed: dict[int, str] = {}
        self._halt = threading.Event()
        hand, held = self._robot.hand, self._setup.held
        opening = hand.opening_max if held is None else self._width(held)
        self._hold, self._drive = self._robot.home, Drive(opening, 0.0, hand.force)
        self._gripping = held is not None
        self._sim.place(self._hold, opening, hand.force if self._gripping else 0.0)

    def scan(self) -> DepthMap:
        self._begin("scan")
        shifts = [fault.vector for _, fault in self._clock.on(self._now) if fault.kind == "bias"]
        for _ in range(int(CALM_S / self._sim.dt)):
            if self._sim.calm(CALM_SPEED, CALM_TURN):
                break
            self._step(self._standing())
        return self._photograph(np.sum([np.zeros(3), *shifts], axis=0))

    def joints(self) -> NDArray:
        return self._sim.q.copy()

    def opening(self) -> float:
        return self._sim.opening

    def wrench(self) -> Wrench:
        return Wrench(*self._sim.wrench())

    def finger_force(self) -> float:
        return self._sim.finger_force

    def stop(self) -> None:
        self._halt.set()

    def follow(self, motion: Trajectory) -> Moved:
        return self._run("follow", motion, lambda: None)

    def descend(self, motion: Trajectory, until_N: float = TOUCH_N) -> Moved:
        before = self._sim.wrench()[0]
        return self._run("descend", motion, lambda: "contact" if np.linalg.norm(self._sim.wrench()[0] - before) >= until_N else None)

    def settle(self, compliance: Compliance = Compliance()) -> Moved:
        self._begin("settle")
        recorder, start, count = Recorder(self._sim), self._sim.hand_pose[:3, 3], 0
        ending: Ending = "arrived"
        for _ in range(int(compliance.time_s / self._sim.dt)):
            force = self._sim.wrench()[0]
            lying = abs(force[2] - compliance.force_N) < SETTLED_SHARE * compliance.force_N
            free = bool(np.linalg.norm(force[:2]) < compliance.yield_N)
            count = count + 1 if lying and free else 0
            if self._halt.is_set() or count >= SETTLED_STEPS:
                ending = "contact" if count >= SETTLED_STEPS else "stopped"
                break
            if np.abs(self._sim.hand_pose[:3, 3] - start).max() > compliance.travel_m:
                break
            self._give_way(np.array([*(force[:2] * (not free)), force[2] - compliance.force_N]))
            recorder.sample(self._hold)
        return self._rested(ending, recorder)

    def grip(self, opening: float, force_N: float | None = None) -> Moved:
        check_opening(self._robot.hand, opening)
        self._begin("grip")
        recorder, now = Recorder(self._sim), self._sim.opening
        limit = self._robot.hand.force if force_N is None else min(force_N, self._robot.hand.force)
        way = int(np.ceil(abs(opening - now) / FINGER_SPEED / self._sim.dt)) + 1
        speed, count = float(np.sign(opening - now)) * FINGER_SPEED, 0
        for k, at in enumerate([*np.linspace(now, opening, way), *np.full(int(LATE_S / self._sim.dt), opening)]):
            self._drive = Drive(float(at), speed if k < way else 0.0, limit)
            self._step(self._standing())
            recorder.sample(self._hold)
            slow = abs(self._sim.finger_speed) < GRIP_SPEED
            there, pressed = abs(self._sim.opening - opening) < GRIP_M, abs(self._sim.finger_force) >= PRESSED * limit
            count = count + 1 if slow and (there or pressed) else 0
            if count >= GRIP_STEPS or self._halt.is_set():
                break
        there = abs(self._sim.opening - opening) < GRIP_M
        ending: Ending = "stopped" if self._halt.is_set() else "arrived" if there else "contact"
        self._gripping = ending == "contact" and opening < now
        self._drive = Drive(opening if ending != "stopped" else self._sim.opening, 0.0, limit)
        return self._rested(ending, recorder)

    def true_scene(self) -> tuple:
        return (*self._sim.true_bodies(), *(self._obstacles[k] for k in sorted(self._there)))

    def held_truly(self) -> str | None:
        return self._sim.held()

    def _width(self, name: str) -> float:
        """How far the fingers are open around a body in the hand at home."""
        body = next(body for body in self._sim.bodies if body.name == name)
        T_hand_body = inverse(self._arm.hand_pose(self._robot.home)) @ body.T_world_body
        low, high = span_between(self._robot.hand, T_hand_body, body, self._robot.hand.opening_max) or (0.0, 0.0)
        return high - low

    def _begin(self, call: Call) -> None:
        self._halt.clear()
        self._clock.called(call, self._now)

    def _run(self, call: Call, motion: Trajectory, watch: Watch) -> Moved:
        """Follow a motion until it ends or something ends it."""
        check_motion(motion, self._robot, self._sim.q)
        self._begin(call)
        return self._follow(course(motion, self._hold, self._sim.dt), watch)

    def _follow(self, way: Course, watch: Watch) -> Moved:
        recorder = Recorder(self._sim)
        ending: Ending = "arrived"
        for k in range(len(way.q) - 1):
            if not self._gripping:
                self._drive = Drive(float(way.opening[k]), float(way.speed[k]), self._drive.force)
            self._step(Reference(way.q[k], way.velocity[k], way.acceleration[k]))
            self._hold = way.q[k + 1]
            recorder.sample(self._hold)
            ended = "stopped" if self._halt.is_set() else watch() or self._hindered()
            if ended:
                ending = ended
                recorder.event(ending)
                self._hold = self._sim.q.copy()
                break
        return self._rested(ending, recorder)

    def _hindered(self) -> Ending | None:
        behind = float(np.abs(self._hold - self._sim.q).max())
        return "blocked" if behind > BLOCKED_RAD or np.linalg.norm(self._sim.wrench()[0]) > BLOCKED_N else None

    def _give_way(self, force: NDArray) -> None:
        """One step of moving the hand along a force (3,) [N], without turning it."""
        velocity = np.clip(YIELD_GAIN * force, -YIELD_SPEED, YIELD_SPEED)
        turn = np.linalg.lstsq(self._sim.jacobian(), np.array([*velocity, 0.0, 0.0, 0.0]), rcond=1e-6)[0]
        self._hold = self._hold + turn * self._sim.dt
        self._step(Reference(self._hold, turn, np.zeros_like(turn)))

    def _rested(self, ending: Ending, recorder: Recorder) -> Moved:
        """Hold until the arm stands still."""
        for _ in range(REST_STEPS):
            self._step(self._standing())
            recorder.sample(self._hold)
            if np.abs(self._sim.velocity).max() < REST_RAD_S and np.abs(self._hold - self._sim.q).max() < REST_RAD:
                break
        return Moved(ending, recorder.recording(self._hold))

    def _standing(self) -> Reference:
        still = np.zeros_like(self._hold)
        return Reference(self._hold, still, still)

    def _step(self, to: Reference) -> None:
        for number, fault, on in self._clock.changes(self._now):
            self._switch(number, fault, on)
        if any(fault.kind == "stuck" and self._sim.opening <= fault.size for _, fault in self._clock.on(self._now)):
            self._sim.jam(self._sim.finger_dofs, True)
        self._sim.step(to, self._drive)
        self._now += self._sim.dt

    def _switch(self, number: int, fault: Fault, on: bool) -> None:
        """A fault begins or ends."""
        name = self._pushed.get(number) or fault.body or self._sim.held()
        if fault.kind in ("slip", "push") and name is not None:
            self._pushed[number] = name
            if fault.kind == "slip":
                self._sim.rub(name, fault.size if on else 1.0)
            else:
                self._sim.push(name, fault.vector if on else np.zeros(3))
        elif fault.kind == "obstacle":
            index = [n for n, other in enumerate(self._setup.faults) if other.kind == "obstacle"].index(number)
            self._sim.appear(index, on)
            self._there = self._there | {index} if on else self._there - {index}
        elif fault.kind == "blocked":
            self._sim.jam(self._sim.arm_dofs[[int(fault.size)]], on)
        elif fault.kind == "stuck" and not on:
            self._sim.jam(self._sim.finger_dofs, False)
