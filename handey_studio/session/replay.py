"""A plan, or what came of it, played over time: one time says where the arm, the fingers and the part are."""

from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value
from handey_studio.task.plan import Carry, MovePlan
from handey_studio.world import Robot, arm_of


@dataclass(frozen=True, eq=False)
class Moment(Value):
    """What holds at one time of a plan. `T_world_part` (4, 4) is where the moved part is, `lost` whether nobody knows that any more; `step`
    counts the plan's steps; `q_command_rad` is where the arm was to be while it was at `q_rad`."""

    time_s: float
    step: int
    q_rad: NDArray
    hand_opening_m: float
    held: str | None
    T_world_part: NDArray
    q_command_rad: NDArray
    lost: bool = False


@dataclass(frozen=True)
class Stretch:
    """A piece of the timeline [s]: a step of the plan, or one of the motions that a step was carried out by. `what` is the step's kind, or
    what was done besides; `step` counts the plan's steps. What leads `back` after an incident counts to the step before it."""

    what: str
    step: int
    start: float
    end: float
    back: bool = False


@dataclass(frozen=True, eq=False)
class Replay(Value):
    """A plan on the robot that it was made for."""

    robot: Robot
    plan: MovePlan

    @cached_property
    def stretches(self) -> tuple[Stretch, ...]:
        """The steps one after the other."""
        ends = np.cumsum([0.0, *(float(step.time_s[-1]) for step in self.plan.steps)]).tolist()
        return tuple(Stretch(step.kind, k, ends[k], ends[k + 1]) for k, step in enumerate(self.plan.steps))

    @cached_property
    def starts(self) -> tuple[float, ...]:
        """When each stretch starts [s], and when the last one ends."""
        return (*(stretch.start for stretch in self.stretches), self.stretches[-1].end)

    @property
    def duration(self) -> float:
        """Length of the whole [s]."""
        return self.starts[-1]

    def stretch_at(self, time_s: float) -> Stretch:
        """The stretch that runs at a time."""
        return self.stretches[max(0, min(bisect_right(self.starts, time_s) - 1, len(self.stretches) - 1))]

    def step_at(self, time_s: float) -> int:
        """Number of the step that runs at a time."""
        return self.stretch_at(time_s).step

    def at(self, time_s: float) -> Moment:
        """What holds at a time [s], which is clipped to the plan's."""
        time_s = float(np.clip(time_s, 0.0, self.duration))
        number = self.step_at(time_s)
        step = self.plan.steps[number]
        local = time_s - self.starts[number]
        q = between(local, step.time_s, step.q_rad)
        opening = float(np.interp(local, step.time_s, step.hand_opening_m))
        return Moment(time_s, number, q, opening, step.held, self._part_pose(number, q), q)

    def let_go(self, time_s: float) -> bool:
        """Whether the part was carried and let go before a time [s]."""
        number = self.step_at(time_s)
        steps = self.plan.steps
        return steps[number].held is None and any(step.held is not None for step in steps[:number])

    def carry_at(self, time_s: float) -> Carry:
        """The carry that is going on at a time [s]: the only one, or the one before or after a regrasp."""
        return self.plan.carry_at(self.step_at(time_s))

    def share_of(self, kind: str, time_s: float) -> float:
        """How much of a carry's first step of a kind is done at a time [s]: 0 before it, 1 after it."""
        first = self.carry_at(time_s).first_step
        stretch = next((one for one in self.stretches if one.what == kind and one.step >= first), None)
        if stretch is None:
            return 1.0
        return float(np.clip((time_s - stretch.start) / max(stretch.end - stretch.start, 1e-9), 0.0, 1.0))

    def hand_path(self, samples: int = 400) -> NDArray:
        """Where the fingertips' middle goes: points (n, 3) [m] in the world, evenly in time."""
        q = np.array([self.at(t).q_rad for t in np.linspace(0.0, self.duration, samples)])
        return arm_of(self.robot).hand_pose(q)[:, :3, 3]

    def clearance(self, time_s: float) -> float | None:
        """How far [m] whatever may not touch is apart at a time [s]; None in plans that did not keep it."""
        number = self.step_at(time_s)
        step = self.plan.steps[number]
        return float(np.interp(time_s - self.starts[number], step.time_s, step.clearance_m)) if len(step.clearance_m) else None

    def _part_pose(self, number: int, q: NDArray) -> NDArray:
        """T_world_part: in the hand while a step holds it, before that where it was found, after that where it was left."""
        step = self.plan.steps[number]
        if step.held is not None and step.T_hand_part is not None:
            return arm_of(self.robot).hand_pose(q) @ step.T_hand_part
        return self._resting[number]

    @cached_property
    def _resting(self) -> tuple[NDArray, ...]:
        """For each step the pose in which the part was last let go."""
        poses, T_world_part = [], self.plan.T_world_part_start
        for step in self.plan.steps:
            poses.append(T_world_part)
            if step.held is not None and step.T_hand_part is not None:
                T_world_part = arm_of(self.robot).hand_pose(step.q_rad[-1]) @ step.T_hand_part
        return tuple(poses)


def between(time_s: float, times: NDArray, samples: NDArray) -> NDArray:
    """Samples (n, k) taken at times (n,), between them at one time (k,)."""
    right = int(np.clip(np.searchsorted(times, time_s, side="right"), 1, max(len(times) - 1, 1)))
    if len(times) == 1:
        return np.array(samples[0])
    span = times[right] - times[right - 1]
    share = np.clip((time_s - times[right - 1]) / span, 0.0, 1.0) if span > 0.0 else 1.0
    return samples[right - 1] + share * (samples[right] - samples[right - 1])
