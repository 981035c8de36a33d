"""What came of a plan, played over the cell's time: the recorded joints and fingers instead of the planned ones."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value
from handey_studio.session.replay import Moment, Replay, Stretch, between
from handey_studio.task.acting.performance import Performance, Recovery
from handey_studio.task.plan import MovePlan, MoveResult
from handey_studio.world import Robot, arm_of

LET_GO_M = 0.004  # fingers that open this much more than when they closed on the part hold it no longer
GONE = ("missed", "dropped")  # incidents after which the part is not in the fingers


@dataclass(frozen=True, eq=False)
class Traces(Value):
    """What was measured over the cell's time, of all motions together: `time_s` (n,) from the attempt's begin; what the outside does to the
    hand, `up_N` and `sideways_N` (n,); each finger's `finger_N` (n,); `opening_m` (n,); and how far the hand's origin was off its command,
    `off_m` (n,)."""

    time_s: NDArray
    up_N: NDArray
    sideways_N: NDArray
    finger_N: NDArray
    opening_m: NDArray
    off_m: NDArray


@dataclass(frozen=True, eq=False)
class Hold(Value):
    """A stretch of time [s] in which the part is in the fingers, as `T_hand_part` (4, 4) says; `lost` whether it ended in a fall."""

    start: float
    end: float
    T_hand_part: NDArray
    lost: bool


@dataclass(frozen=True, eq=False)
class PerformedReplay(Replay):
    """A plan and how it was carried out."""

    performance: Performance

    @cached_property
    def stretches(self) -> tuple[Stretch, ...]:
        """The motions that were made."""
        starts = [one.start_s for one in self.performance.performed]
        last = self.performance.performed[-1]
        ends = [*starts[1:], last.start_s + float(last.recording.time_s[-1])]
        steps = np.maximum.accumulate([max(one.step, 0) for one in self.performance.performed]).tolist()
        told = zip(self.performance.performed, steps, starts, ends, strict=True)
        return tuple(Stretch(one.what, step, start, end, one.step < 0) for one, step, start, end in told)

    def at(self, time_s: float) -> Moment:
        """What was measured at a time [s], which is clipped to the attempt's."""
        time_s = float(np.clip(time_s, 0.0, self.duration))
        times = self.traces.time_s
        q, q_command = between(time_s, times, self._joints[0]), between(time_s, times, self._joints[1])
        opening = float(np.interp(time_s, times, self.traces.opening_m))
        hold = next((hold for hold in self.holds if hold.start <= time_s < hold.end), None)
        held = self.plan.part if hold is not None else None
        return Moment(time_s, self.step_at(time_s), q, opening, held, self._place(time_s, q, hold), q_command, self._lost(time_s))

    def let_go(self, time_s: float) -> bool:
        """Whether the part was carried and let go before a time [s]."""
        return any(hold.end <= time_s for hold in self.holds)

    def clearance(self, time_s: float) -> float | None:
        """That of the plan [m] where it is nearest to what the arm really did; None in plans that did not keep it."""
        step = self.plan.steps[self.step_at(time_s)]
        if not len(step.clearance_m):
            return None
        q = between(time_s, self.traces.time_s, self._joints[0])
        return float(step.clearance_m[np.argmin(np.abs(step.q_rad - q).max(axis=1))])

    @cached_property
    def traces(self) -> Traces:
        """Everything that was measured, in one."""
        arm = arm_of(self.robot)
        places = [arm.hand_pose(q)[:, :3, 3] for q in self._joints]
        times = np.concatenate([one.start_s + one.recording.time_s for one in self.performance.performed])
        force, off = self._column("force_N"), np.linalg.norm(places[0] - places[1], axis=1)
        sideways = np.linalg.norm(force[:, :2], axis=1)
        return Traces(times, force[:, 2], sideways, self._column("finger_force_N"), self._column("opening_m"), off)

    @cached_property
    def _joints(self) -> tuple[NDArray, NDArray]:
        return self._column("q_rad"), self._column("q_command_rad")

    def _column(self, name: str) -> NDArray:
        return np.concatenate([getattr(one.recording, name) for one in self.performance.performed])

    @cached_property
    def holds(self) -> tuple[Hold, ...]:
        """From each closing on the part until the fingers open, or until it was noticed that it fell."""
        gone = {incident.step for incident in self.performance.incidents if incident.kind in GONE}
        holds: list[Hold] = []
        for one, stretch in zip(self.performance.performed, self.stretches, strict=True):
            if one.what == "close" and one.ended == "contact" and one.step not in gone:
                width = float(one.recording.opening_m[-1])
                end, lost = self._until(stretch.end, width, gone)
                holds.append(Hold(stretch.end, end, self.plan.carry_at(one.step).grasp.T_hand_part, lost))
        return tuple(holds)

    def _until(self, start: float, width: float, gone: set[int]) -> tuple[float, bool]:
        """When the fingers that closed to a width let go of it, and whether it fell."""
        times, opening = self.traces.time_s, self.traces.opening_m
        opened = times[(times > start) & (opening > width + LET_GO_M)]
        end = float(opened[0]) if len(opened) else self.duration + 1.0
        fell = [stretch.end for stretch in self.stretches if stretch.step in gone and not stretch.back and start <= stretch.end <= end]
        return (min(fell), True) if fell else (end, False)

    def _place(self, time_s: float, q: NDArray, hold: Hold | None) -> NDArray:
        """T_world_part: in the fingers, or where it was let go; at the very last where the scan saw it."""
        arm = arm_of(self.robot)
        if hold is not None:
            return arm.hand_pose(q) @ hold.T_hand_part
        before = [one for one in self.holds if one.end <= time_s]
        if not before:
            return self.plan.T_world_part_start
        check = self.performance.check
        if before[-1] is self.holds[-1] and check is not None and check.T_world_part is not None:
            return check.T_world_part
        return arm.hand_pose(between(before[-1].end, self.traces.time_s, self._joints[0])) @ before[-1].T_hand_part

    def _lost(self, time_s: float) -> bool:
        before = [one for one in self.holds if one.end <= time_s]
        return bool(before) and before[-1].lost


@dataclass(frozen=True, eq=False)
class Told(Value):
    """One attempt of a MOVE: its plan, how it went (None while it was not carried out), and what was decided after it."""

    plan: MovePlan
    performance: Performance | None
    recovery: Recovery | None = None


def attempts_of(result: MoveResult) -> tuple[Told, ...]:
    """Every attempt of a result in order, the last one being that of its plan."""
    told = [Told(one.plan, one.performance, one.recovery) for one in result.attempts]
    if result.plan is not None and result.plan.steps:
        told.append(Told(result.plan, result.performance))
    return tuple(told)


def replay_of(robot: Robot, told: Told) -> Replay:
    """What is played of an attempt: what really happened if it was carried out, else the plan."""
    if told.performance is None or not told.performance.performed:
        return Replay(robot, told.plan)
    return PerformedReplay(robot, told.plan, told.performance)


def seconds_of(replay: Replay, step: int) -> float:
    """When what was noticed at a plan's step was noticed [s]: at its end; before the first step and after the last at the ends."""
    ends = [stretch.end for stretch in replay.stretches if stretch.step == step and not stretch.back]
    return ends[-1] if ends else (0.0 if step < 0 else replay.duration)
