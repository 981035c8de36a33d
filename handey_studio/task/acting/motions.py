"""Acting in a cell: motions one after the other, and a record of each."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.protocol import Cell, Moved
from handey_studio.cell.recording import tracking_error
from handey_studio.motion import PathResult, Trajectory, time_path
from handey_studio.task.acting.performance import Performed, thinned
from handey_studio.task.plan import Step
from handey_studio.world import Robot, arm_of

WAY_BACK = -1  # the number of the step that motions on the way back belong to
SAME_RAD = 1e-9


class Acting:
    """A cell with the record of what was done in it, from one attempt's begin to its end. Lives as long as the attempt does."""

    def __init__(self, cell: Cell, robot: Robot) -> None:
        self.cell, self.robot = cell, robot
        self.performed: list[Performed] = []
        self._clock = 0.0

    def follow(self, step: int, what: str, motion: Trajectory) -> Moved:
        """The whole motion, led in from where the arm stands."""
        return self._record(step, what, self.cell.follow(self._led_in(motion)))

    def descend(self, step: int, what: str, motion: Trajectory) -> Moved:
        """The motion until something is felt."""
        return self._record(step, what, self.cell.descend(self._led_in(motion)))

    def settle(self, step: int) -> Moved:
        """Let what the hand holds come to lie on its support."""
        return self._record(step, "settle", self.cell.settle())

    def grip(self, step: int, what: str, opening: float) -> Moved:
        """Fingers towards an opening [m], within what the hand has."""
        hand = self.robot.hand
        return self._record(step, what, self.cell.grip(float(np.clip(opening, hand.opening_min, hand.opening_max))))

    def wait(self, step: int, seconds: float) -> Moved:
        """Stand still for a while."""
        q, opening = self.cell.joints(), self.cell.opening()
        return self._record(step, "wait", self.cell.follow(Trajectory(np.array([0.0, seconds]), np.array([q, q]), np.full(2, opening))))

    def hand_now(self) -> NDArray:
        """T_world_hand (4, 4) by the arm's joints."""
        return arm_of(self.robot).hand_pose(self.cell.joints())

    def _led_in(self, motion: Trajectory) -> Trajectory:
        """A guarded motion may have left the arm a little off where the next one begins."""
        q = self.cell.joints()
        if np.abs(q - motion.q_rad[0]).max() < SAME_RAD:
            return motion
        lead = time_path(self.robot, PathResult("found", "", np.array([q, motion.q_rad[0]])), float(motion.hand_opening_m[0]))
        return Trajectory(
            np.concatenate([lead.time_s, lead.time_s[-1] + motion.time_s[1:]]),
            np.concatenate([lead.q_rad, motion.q_rad[1:]]),
            np.concatenate([lead.hand_opening_m, motion.hand_opening_m[1:]]),
        )

    def _record(self, step: int, what: str, moved: Moved) -> Moved:
        recording = moved.recording
        error = tracking_error(recording, arm_of(self.robot))
        self.performed.append(Performed(step, what, self._clock, moved.ended, thinned(recording), error))
        self._clock += moved.time_s
        return moved


def motion_of(step: Step, slower: float = 1.0) -> Trajectory:
    """A step as a motion, `slower` times as slow."""
    return Trajectory(step.time_s * slower, step.q_rad, step.hand_opening_m)


def fingers_only(step: Step) -> bool:
    """Whether the arm stands still in a step."""
    return bool(np.abs(step.q_rad - step.q_rad[0]).max() < SAME_RAD)
