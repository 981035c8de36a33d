"""The way back after an incident: with the part to where it was taken up, then with an empty hand to where the plan began.

The way that the arm came by was free, so it goes back the same way; only from where it let the part fall it looks for a new one.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Progress, Silent
from handey_studio.cell.protocol import CannotAct, Moved
from handey_studio.motion import PathOptions, Trajectory, plan_path, time_path
from handey_studio.task.acting.motions import WAY_BACK, fingers_only
from handey_studio.task.acting.noticing import not_arrived
from handey_studio.task.acting.perform import GUARDED_SLOWER, PAUSE_S, TRIES, Performer
from handey_studio.task.acting.performance import Incident
from handey_studio.task.plan import Step
from handey_studio.world import World

BACK_SPEED, EASE_S = 0.5, 0.4  # share of the plan's speed on the way back, and the time in which it is gathered


@dataclass(frozen=True)
class CameBack:
    """What was done, in words, and what stopped it, None when the arm is back with an empty hand."""

    actions: tuple[str, ...] = ()
    stopped: Incident | None = None


def come_back(performer: Performer, step: int, world: World, progress: Progress = Silent()) -> CameBack:
    """From where a performance ended in `step`. `world` is what the planner believes, in which a new way is looked for."""
    actions: list[str] = []
    try:
        stopped = _put_back(performer, step, actions) if performer.holding else _emptied(performer, step, actions)
        if stopped is None:
            stopped = _home(performer, step, world, actions, progress)
    except CannotAct as error:
        stopped = Incident("refused", WAY_BACK, str(error))
    return CameBack(tuple(actions), stopped)


def _put_back(performer: Performer, step: int, actions: list[str]) -> Incident | None:
    """The part goes back the way it came, is set down where it was taken up, and let go."""
    steps, carry = performer.task.plan.steps, performer.task.plan.carry_at(step)
    if steps[step].kind == "open":
        return Incident("hand stuck", WAY_BACK, "the fingers do not let go of the part; the arm stays where it is")
    taken = next(k for k in range(step, -1, -1) if steps[k].kind == "close")
    for k in range(step, taken, -1):
        stopped = _backwards(performer, steps[k], guarded=steps[k].kind == "lift")
        if stopped is not None:
            return stopped
    actions.append("the part is put back where it was taken up")
    stopped = performer.let_go(WAY_BACK, carry.grasp.opening)
    performer.holding = stopped is not None
    return stopped or _back_along(performer, taken - 1, actions)


def _emptied(performer: Performer, step: int, actions: list[str]) -> Incident | None:
    """An empty hand opens, and where nothing was taken up yet the arm goes back the way it came."""
    steps, carry = performer.task.plan.steps, performer.task.plan.carry_at(step)
    if performer.cell.opening() < carry.grasp.opening and any(one.kind == "close" for one in steps[carry.first_step : step + 1]):
        stopped = performer.let_go(WAY_BACK, carry.grasp.opening)
        if stopped is not None:
            return stopped
        actions.append("the hand opens")
    if all(one.held is None for one in steps[carry.first_step : step + 1]):
        return _back_along(performer, step, actions)
    return None


def _back_along(performer: Performer, step: int, actions: list[str]) -> Incident | None:
    """Steps of an empty hand backwards, from `step` to the first of its carry."""
    steps, carry = performer.task.plan.steps, performer.task.plan.carry_at(step)
    for k in range(step, carry.first_step - 1, -1):
        if fingers_only(steps[k]):
            continue
        stopped = _backwards(performer, steps[k])
        if stopped is not None:
            return stopped
    actions.append("the arm goes back the way it came")
    return None


def _home(performer: Performer, step: int, world: World, actions: list[str], progress: Progress) -> Incident | None:
    """To where the plan began, if the way back did not end there."""
    acting, start = performer.acting, performer.task.plan.steps[0].q_rad[0]
    q = performer.cell.joints()
    if np.abs(q - start).max() < 1e-3:
        return None
    ended = performer.task.plan.steps[step]
    if ended.kind == "free" and np.abs(q - ended.q_rad[-1]).max() > 1e-3:
        stopped = _backwards(performer, ended)
        if stopped is not None:
            return stopped
        q = performer.cell.joints()
    opening = performer.cell.opening()
    path = plan_path(world, q, start, opening, options=PathOptions(), rng=np.random.default_rng(0), progress=progress)
    if not path.found:
        return Incident("blocked", WAY_BACK, f"no way home is known: {path.reason}")
    actions.append("the arm goes home another way")
    return _patiently(performer, "home", lambda: acting.follow(WAY_BACK, "home", time_path(world.robot, path, opening)), start)


def _backwards(performer: Performer, step: Step, guarded: bool = False) -> Incident | None:
    """The arm goes a step's way back to its beginning, with the fingers as they are; `guarded` down to where it touches."""

    def go() -> Moved:
        way = _reversed(step, performer.cell.joints())
        motion = replace(way, hand_opening_m=np.full(len(way.time_s), performer.cell.opening()))
        if guarded:
            return performer.acting.descend(WAY_BACK, what, replace(motion, time_s=motion.time_s * GUARDED_SLOWER))
        return performer.acting.follow(WAY_BACK, what, motion)

    what = f"{step.kind}, backwards"
    return _patiently(performer, what, go, step.q_rad[0])


def _patiently(performer: Performer, what: str, go: Callable[[], Moved], q: NDArray) -> Incident | None:
    """A motion to `q` (joints,) [rad], tried again after a pause when it is blocked."""
    stopped = None
    for count in range(TRIES):
        if count:
            performer.acting.wait(WAY_BACK, PAUSE_S)
        stopped = not_arrived(go(), q, WAY_BACK, what)
        if stopped is None or stopped.kind == "stopped":
            break
    return stopped


def _reversed(step: Step, q: NDArray) -> Trajectory:
    """A step backwards from the sample that is nearest to where the arm is: at half the speed, and from rest though it may begin midway."""
    k = int(np.argmin(np.abs(step.q_rad - q).max(axis=1))) + 1
    return Trajectory(_eased(step.time_s[k - 1] - step.time_s[:k][::-1]), step.q_rad[:k][::-1], step.hand_opening_m[:k][::-1])


def _eased(time_s: NDArray) -> NDArray:
    """Times (n,) [s] at which a motion is where it was at `time_s` (n,), when it first gathers speed and then keeps a share of its own."""
    gathered = BACK_SPEED * EASE_S / 2
    return np.where(
        time_s < gathered, np.sqrt(2.0 * EASE_S * time_s / BACK_SPEED), EASE_S + (np.maximum(time_s, gathered) - gathered) / BACK_SPEED
    )
