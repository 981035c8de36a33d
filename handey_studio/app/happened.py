"""What happened when a MOVE was carried out, as a list to be read and clicked: incidents, what was decided and why, the last check."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from handey_studio.app.ledger_commands import LookAtEntry
from handey_studio.app.playback import LookAtAttempt
from handey_studio.app.state import State
from handey_studio.session import Told, replay_of, seconds_of
from handey_studio.session.ledger_tree import ROOT
from handey_studio.task.acting.performance import Check, Incident, Recovery
from handey_studio.task.plan import MoveResult
from handey_studio.world import Robot

MOST_ROWS = 24

Kind = Literal["incident", "overcome", "decision", "given up", "check", "unsure"]


@dataclass(frozen=True)
class Happening:
    """One row: at `time_s` of an attempt (both from 0), with the entry of the ledger that tells of it, `ROOT` for none."""

    kind: Kind
    attempt: int
    time_s: float
    title: str
    sentence: str
    entry: int = ROOT


@dataclass(frozen=True)
class LookAtHappening:
    """Look at the moment of a row; the ledger opens at its entry."""

    row: int

    def apply(self, state: State) -> State:
        rows = happenings(state)
        if not 0 <= self.row < len(rows):
            return state
        row = rows[self.row]
        return LookAtEntry(row.entry).apply(LookAtAttempt(row.attempt, row.time_s).apply(state))


def happenings(state: State) -> tuple[Happening, ...]:
    """Everything that happened in the MOVE that is looked at, in order."""
    result = state.session.result
    return happened(state.robot, result, state.attempts)[:MOST_ROWS] if result is not None else ()


def happened(robot: Robot, result: MoveResult, attempts: tuple[Told, ...]) -> tuple[Happening, ...]:
    """The same of any result."""
    rows: list[Happening] = []
    for number, told in enumerate(attempts):
        if told.performance is None:
            continue
        replay = replay_of(robot, told)
        rows += [_incident(number, seconds_of(replay, one.step), _step_name(told, one.step), one) for one in told.performance.incidents]
        if told.recovery is not None:
            rows.append(_decision(number, seconds_of(replay, told.recovery.incident.step), told.recovery))
        if told.performance.check is not None:
            rows.append(_check(number, replay.duration, told.performance.check))
    if rows and result.status == "failed" and result.performance is not None:
        rows.append(Happening("given up", rows[-1].attempt, rows[-1].time_s, "Given up", result.reason))
    return tuple(rows)


def _step_name(told: Told, step: int) -> str:
    steps = told.plan.steps
    if step < 0:
        return "before the first step"
    return f"step {step + 1}, {steps[step].kind}" if step < len(steps) else "after the last step"


def _incident(attempt: int, time_s: float, where: str, incident: Incident) -> Happening:
    kind: Kind = "overcome" if incident.overcome else "incident"
    more = "; overcome on the spot" if incident.overcome else ""
    title = f"{incident.kind[:1].upper()}{incident.kind[1:]}, {where}"
    return Happening(kind, attempt, time_s, title, f"{incident}{more}.", incident.entry)


def _decision(attempt: int, time_s: float, recovery: Recovery) -> Happening:
    words = [recovery.why, *recovery.actions]
    if recovery.ruled_out is not None:
        words.append(f"ruled out from now on: this {recovery.ruled_out.kind}, as {recovery.ruled_out.why}")
    if recovery.felt is not None:
        words.append("a block stands from now on where something was felt")
    return Happening("decision", attempt, time_s, "Another attempt", _sentence(words))


def _check(attempt: int, time_s: float, check: Check) -> Happening:
    off = ""
    if check.off_m is not None and check.off_rad is not None:
        off = f": {1e3 * check.off_m:.1f} mm and {np.rad2deg(check.off_rad):.1f}° from the command"
    rivals = f"; the view cannot tell it from {', '.join(check.rivals)}" if check.rivals else ""
    kind: Kind = "check" if check.found in ("seen", "agrees") else "unsure"
    return Happening(kind, attempt, time_s, "The check by a new scan", f"{check.sentence}{off}{rivals}.")


def _sentence(words: list[str]) -> str:
    """Clauses one after the other."""
    return "; ".join(word.rstrip(".") for word in words if word) + "."
