"""The simulated cell without forces: the arm goes where it is told, grips and guarded motions are geometry."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.gripping import close_fingers, span_between
from handey_studio.cell.guarded import first_touch, motion_at
from handey_studio.cell.motions import check_motion, check_opening
from handey_studio.cell.physics.settling import settle
from handey_studio.cell.protocol import TOUCH_N, Compliance, Moved, Wrench
from handey_studio.cell.recording import Event, Recording, as_commanded
from handey_studio.cell.truth import TrueState, true_bodies
from handey_studio.cell.workcell import Workcell
from handey_studio.geometry.transforms import inverse
from handey_studio.motion import Trajectory
from handey_studio.world.library import Library

RELEASE_M = 1e-4  # fingers that open by more than this let go
LIFTED_M = 0.01  # once the held body has moved this far, what leaned on it falls


@dataclass(frozen=True)
class _Held:
    name: str
    T_hand_body: NDArray
    T_world_body_start: NDArray
    left: bool = False


class GeometricCell(TrueState):
    """A simulated cell without forces: quick, and exact where physics would only add its own.

    The arm follows every motion exactly and passes through what is in its way: the plan's checker tells collisions, not the
    cell. Gripping and guarded motions are geometric; bodies that are let go, or lose their support, fall by physics. Faults are passed
    over: they are of forces.
    """

    physics = False

    def __init__(self, workcell: Workcell, library: Library) -> None:
        super().__init__(workcell, library)
        self._bodies = true_bodies(workcell, library)
        self._q = self._robot.home
        self._held = self._held_at_start()
        self._opening = self._robot.hand.opening_max if self._held is None else self._width(self._held)
        self._pressing = self._held is not None
        self._touching = False

    def joints(self) -> NDArray:
        return self._q

    def opening(self) -> float:
        return self._opening

    def wrench(self) -> Wrench:
        return Wrench(np.zeros(3), np.zeros(3))

    def finger_force(self) -> float:
        return self._robot.hand.force if self._pressing else 0.0

    def stop(self) -> None:
        """Nothing to stop: a motion here takes no time."""

    def follow(self, motion: Trajectory) -> Moved:
        check_motion(motion, self._robot, self._q)
        return self._arrive(motion, float(motion.time_s[-1]))

    def descend(self, motion: Trajectory, until_N: float = TOUCH_N) -> Moved:
        check_motion(motion, self._robot, self._q)
        held = None if self._held is None else (self._body(self._held.name), self._held.T_hand_body)
        others = [body for body in self._bodies if held is None or body.name != held[0].name]
        time = first_touch(self._arm, motion, others, held)
        if time is None:
            return self._arrive(motion, float(motion.time_s[-1]))
        return self._arrive(motion, time, touched_N=until_N)

    def settle(self, compliance: Compliance = Compliance()) -> Moved:
        return Moved("contact" if self._touching else "arrived", self._still())

    def grip(self, opening: float, force_N: float | None = None) -> Moved:
        check_opening(self._robot.hand, opening)
        if self._held is not None:
            self._regrip(opening)
        elif opening < self._opening:
            T_world_hand = self._arm.hand_pose(self._q)
            grip = close_fingers(self._robot.hand, T_world_hand, self._bodies, self._opening, opening)
            self._opening, self._pressing = grip.opening, grip.opening > opening
            if grip.held is not None and grip.T_hand_body is not None:
                self._held = _Held(grip.held, grip.T_hand_body, self._body(grip.held).T_world_body)
                self._pressing = True
                self._carry()
        else:
            self._opening, self._pressing = float(opening), False
        return Moved("contact" if self._pressing else "arrived", self._still())

    def true_scene(self) -> tuple[SolidBody, ...]:
        return self._bodies

    def held_truly(self) -> str | None:
        return self._held.name if self._held else None

    def _arrive(self, motion: Trajectory, time: float, touched_N: float | None = None) -> Moved:
        """At the motion's `time`, where it ended: by touch if a force is given."""
        times = np.append(motion.time_s[motion.time_s < time], time)
        q = np.array([motion_at(motion, at) for at in times])
        self._q, self._touching = q[-1], touched_N is not None
        if self._held is None:
            self._opening = float(np.interp(time, motion.time_s, motion.hand_opening_m))
        else:
            self._carry()
        events = () if touched_N is None else (Event(time, "touch", touched_N),)
        return Moved("contact" if self._touching else "arrived", as_commanded(times, q, self._opening, self.finger_force(), events))

    def _still(self) -> Recording:
        return as_commanded(np.zeros(1), self._q[None], self._opening, self.finger_force())

    def _carry(self) -> None:
        """Put the held body where the hand has it; once it has left its place, let the others settle."""
        held = self._held
        if held is None:
            return
        T_world_body = self._arm.hand_pose(self._q) @ held.T_hand_body
        self._replace([self._body(held.name).at(T_world_body)])
        if not held.left and np.linalg.norm(T_world_body[:3, 3] - held.T_world_body_start[:3, 3]) > LIFTED_M:
            self._held = replace(held, left=True)
            self._replace(settle([body for body in self._bodies if body.name != held.name]).bodies)

    def _regrip(self, opening: float) -> None:
        if opening > self._opening + RELEASE_M:
            self._held, self._pressing, self._opening = None, False, float(opening)
            self._replace(settle(self._bodies).bodies)

    def _held_at_start(self) -> _Held | None:
        name = self._setup.held
        if name is None:
            return None
        T_world_body = self.true_pose(name)
        return _Held(name, inverse(self._arm.hand_pose(self._q)) @ T_world_body, T_world_body, left=True)

    def _width(self, held: _Held) -> float:
        hand = self._robot.hand
        low, high = span_between(hand, held.T_hand_body, self._body(held.name), hand.opening_max) or (0.0, 0.0)
        return high - low

    def _body(self, name: str) -> SolidBody:
        return next(body for body in self._bodies if body.name == name)

    def _replace(self, moved: Iterable[SolidBody]) -> None:
        new = {body.name: body for body in moved}
        self._bodies = tuple(new.get(body.name, body) for body in self._bodies)
