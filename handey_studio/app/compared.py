"""MOVEs before and after a calibration, side by side in numbers: what each came to, and where the range finder truly stood then."""

from dataclasses import replace

import numpy as np

from handey_studio.app.outcome import Outcome
from handey_studio.app.state import State
from handey_studio.app.wording import arrow_words
from handey_studio.geometry.transforms import pose_difference
from handey_studio.session import Session
from handey_studio.task.plan import MoveResult

CALIBRATED = 1e-3  # what is less off, in metres or as a share of a right angle, was calibrated well
MOST_OUTCOMES = 6


def is_misplaced(state: State) -> bool:
    """Whether the simulated range finder was moved on purpose, and not yet calibrated since."""
    T = state.session.workcell.setup.T_range_offset
    return not np.allclose(T, np.eye(4), atol=CALIBRATED)


def with_outcome(state: State) -> State:
    """The state that remembers the numbers of the MOVE that was just tried: they outlive its result."""
    result = state.session.result
    if result is None:
        return state
    return replace(state, outcomes=(*state.outcomes, outcome_of(state, result))[-MOST_OUTCOMES:])


def outcome_of(state: State, result: MoveResult) -> Outcome:
    """What a MOVE came to."""
    check = result.performance.check if result.performance is not None else None
    seen = None if check is None or check.off_m is None or check.off_rad is None else (check.off_m, check.off_rad)
    noticed = sum(len(performance.incidents) for performance in result.performances)
    said = arrow_words(result.command)
    off = truly_off(state.session, result) if result.status == "done" else None
    return Outcome(is_misplaced(state), said, result.status, result.reason, len(result.performances), noticed, seen, off)


def truly_off(session: Session, result: MoveResult) -> tuple[float, float] | None:
    """How far [m, rad] the part truly stands from its command, up to its symmetries; None where there is no plan. Known only because the
    cell is a simulated one, and told only when all is over."""
    part, setup = session.part(result.command.part), session.cell_now
    if part is None or setup is None or result.plan is None:
        return None
    goal, name = result.plan.T_world_part_goal, result.command.part.split("#")[0]
    bodies = [body.T_world_body for body in setup.bodies if name in (body.part, body.name)]
    return min((pose_difference(T @ S, goal) for T in bodies for S in part.symmetries), default=None)
