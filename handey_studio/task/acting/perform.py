"""Carrying out a plan in a cell, step by step (Handey 1987 §2): grip, guarded placement, release; what goes wrong is noticed and told."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Progress, Value, frozen_array
from handey_studio.cell.protocol import CannotAct, Cell, Moved
from handey_studio.motion import Trajectory, straight_path, time_path
from handey_studio.task.acting.motions import Acting, fingers_only, motion_of
from handey_studio.task.acting.noticing import (
    GRIP_TOLERANCE_M,
    SEARCH_M,
    Hold,
    came_down,
    closed_on,
    fingers_went,
    gave_way,
    hold_of,
    lifted,
    not_arrived,
    still_held,
)
from handey_studio.task.acting.performance import Incident, Performance
from handey_studio.task.plan import Carry, MovePlan, Step
from handey_studio.world import Held, Part, World, arm_of

GUARDED_SLOWER = 4.0  # guarded descents are so much slower than the plan: what they meet is met gently
TRIES, PAUSE_S = 4, 1.5  # what sticks or is blocked is tried again after a pause: some hindrances go by themselves


@dataclass(frozen=True, eq=False)
class Task(Value):
    """A plan with what it was made for: the moved part's model and the world without it, in which the guarded descent is continued."""

    plan: MovePlan
    part: Part
    carried: World

    def held(self, carry: Carry) -> Held:
        """The part in the hand during a carry."""
        return Held(self.plan.part, self.part, frozen_array(carry.grasp.T_hand_part))


class Performer:
    """One attempt at a plan. `perform` does it; afterwards it tells where it ended and whether the hand may still hold the part."""

    def __init__(self, task: Task, cell: Cell) -> None:
        self.task, self.cell = task, cell
        self.acting = Acting(cell, task.carried.robot)
        self.holding = False
        self.incidents: list[Incident] = []
        self._hold: Hold | None = None
        self._released: NDArray | None = None

    def perform(self, progress: Progress) -> Incident | None:
        """Every step, until something goes otherwise than planned: that, or None when all is done."""
        steps = self.task.plan.steps
        for number, step in enumerate(steps):
            progress.report(number / len(steps), f"step {number + 1} of {len(steps)}: {step.kind}")
            incident = None if progress.cancelled else self._do(number, step)
            if progress.cancelled:
                return self._noticed(Incident("stopped", number, "cancelled"))
            if incident is not None:
                return self._noticed(incident)
        return None

    def _noticed(self, incident: Incident) -> Incident:
        self.incidents.append(incident)
        return incident

    def told(self) -> Performance:
        """What was done so far."""
        return Performance(tuple(self.acting.performed), tuple(self.incidents), self._released)

    def _do(self, number: int, step: Step) -> Incident | None:
        carry = self.task.plan.carry_at(number)
        try:
            if step.kind == "close":
                return self._close(number, carry)
            if step.kind == "place":
                return self._place(number, step, carry)
            if step.kind == "open":
                return self._open(number, step, carry)
            return self._move(number, step, carry)
        except CannotAct as error:
            return Incident("refused", number, str(error))

    def _close(self, number: int, carry: Carry) -> Incident | None:
        moved = self.acting.grip(number, "close", closing(carry))
        incident = closed_on(moved, carry.grasp.width, number)
        self.holding = incident is None
        self._hold = None
        return incident

    def _move(self, number: int, step: Step, carry: Carry) -> Incident | None:
        """A motion, or fingers in free air; what is carried is looked after."""
        if fingers_only(step):
            return self.let_go(number, float(step.hand_opening_m[-1]), step.kind)
        moved = self.acting.follow(number, step.kind, motion_of(step))
        return not_arrived(moved, step.q_rad[-1], number, step.kind) or (self._lost(number, carry) if step.held else None)

    def _lost(self, number: int, carry: Carry) -> Incident | None:
        """Whether the part that is carried left the fingers or moved in them; after the lift it is felt for the first time."""
        now = self._hold_now(self.task.held(carry))
        before, self._hold = self._hold or lifted(now, carry.grasp.width, self.task.carried.robot.hand), now
        lost = still_held(now, before, closing(carry), self.cell.physics, number)
        self.holding = lost is None or lost.kind != "dropped"
        return lost

    def _place(self, number: int, step: Step, carry: Carry) -> Incident | None:
        """Descend until contact, a little beyond the commanded pose if need be, then let the part come to rest on its support.

        Where it rests there already, pushed up in fingers that hold it loosely, it is not pressed down: the check tells where it stands.
        """
        held = self.task.held(carry)
        moved = self.acting.descend(number, "place", motion_of(step, GUARDED_SLOWER))
        if moved.ended == "arrived":
            moved = self._deeper(number, step, carry, held) or moved
        gone = gave_way(self._hold_now(held), self._hold, self.cell.physics, number) if moved.ended == "arrived" else None
        if gone is not None:
            self.incidents.append(gone)
            return None
        incident = not_arrived(moved, step.q_rad[-1], number, step.kind) or came_down(self._height(carry, held), moved.contact, number)
        if incident is None:
            self.acting.settle(number)
        return incident

    def _hold_now(self, held: Held) -> Hold:
        return hold_of(self.cell, held, self.acting.hand_now())

    def _deeper(self, number: int, step: Step, carry: Carry, held: Held) -> Moved | None:
        """The descent goes on below the commanded pose; None where there is no straight way."""
        world, q = self.task.carried, self.cell.joints()
        poses = np.repeat(arm_of(world.robot).hand_pose(q)[None], 4, axis=0)
        poses[:, 2, 3] -= np.linspace(0.0, SEARCH_M, len(poses))
        path = straight_path(world, q, poses, carry.grasp.width, held, step.allowed_contacts)
        if not path.found:
            return None
        timed = time_path(world.robot, path, carry.grasp.width)
        return self.acting.descend(number, "search", Trajectory(timed.time_s * GUARDED_SLOWER, timed.q_rad, timed.hand_opening_m))

    def _open(self, number: int, step: Step, carry: Carry) -> Incident | None:
        """Let go; fingers that stick are sent again."""
        self._released = self.acting.hand_now() @ carry.grasp.T_hand_part
        incident = self.let_go(number, float(step.hand_opening_m[-1]))
        self.holding = incident is not None
        return incident

    def let_go(self, number: int, opening: float, what: str = "open") -> Incident | None:
        """Fingers out to an opening [m]; those that stick are sent again after a pause."""
        hand, stuck = self.task.carried.robot.hand, None
        for count in range(TRIES):
            if count:
                self.acting.wait(number, PAUSE_S)
            incident = fingers_went(self.acting.grip(number, what, opening), opening, hand, number)
            if incident is None:
                self.incidents += [replace(stuck, overcome=True)] if stuck else []
                return None
            stuck = stuck or incident
        return stuck

    def _height(self, carry: Carry, held: Held) -> float:
        """How far [m] the part is above its destination by the arm's joints."""
        return float((self.acting.hand_now() @ held.T_hand_part)[2, 3] - carry.T_world_part_goal[2, 3])


def closing(carry: Carry) -> float:
    """Where the fingers are sent [m] to press on the part: they come to there only when it is gone."""
    return carry.grasp.width - GRIP_TOLERANCE_M
