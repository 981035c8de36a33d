"""Calibrating the range finder to the robot (Handey 1987 §6) from the workbench: start, accept, discard; the hidden misplacement."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from handey_studio.app.actions import Bench
from handey_studio.app.jobs import JobStarted, check_idle
from handey_studio.app.settings import with_finder_at
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.session import Session
from handey_studio.session.calibrating import calibrated, cell_with_cube, misplaced
from handey_studio.session.run import station_of
from handey_studio.task.calibrating.calibrate import CalibrateOptions, RangeCalibration, calibrate_range
from handey_studio.task.calibrating.report import calibration_lines
from handey_studio.world import Library

MOST_OFF_M = np.array([0.009, 0.009, 0.0003])  # of a misplacement that is drawn by chance: a table that seems to rise forbids every MOVE
MOST_TURN_RAD = np.deg2rad(1.5)

MISPLACED = (
    f"The range finder was moved by up to {1e3 * MOST_OFF_M[0]:.0f} mm each way and turned by up to {np.rad2deg(MOST_TURN_RAD):.1f}°. "
    "MOVE to see what comes of it, then calibrate: that tells how far it was."
)
MISPLACED_HINT = "The simulated range finder is moved and turned by chance; by how much, calibrating tells"
BACK = "The range finder stands where it is believed to stand again."
ACCEPTED = "The range finder is believed to stand where the calibration found it. MOVE again to compare; the numbers are listed below."
GONE = "What was scanned, planned and done before went with it."


@dataclass(frozen=True)
class StartCalibration:
    """The hand shows a cube at so many poses, each is scanned."""

    poses: int

    def run(self, bench: Bench) -> State:
        check_idle(bench.state)
        options = CalibrateOptions(self.poses, seed=bench.state.session.seed)
        state = JobStarted(True, "Calibrating", calibration_done).apply(replace(bench.state, calibration=None))
        bench.planner.order(state.jobs, state.session, state.library, True, partial(calibrate, options))
        return state


def calibrate(options: CalibrateOptions, session: Session, library: Library, execute: bool, progress: Any) -> RangeCalibration:
    """In the planner's process: put the cube into the hand and calibrate."""
    cell = cell_with_cube(session, library, options.side_m)
    return calibrate_range(station_of(session, library), cell, options, progress)


def calibration_done(state: State, found: RangeCalibration) -> State:
    """The state when a calibration has ended: what was found waits to be accepted."""
    if found.fit is None:
        return replace(state, calibration=found).told(f"The calibration failed: {found.reason}", "bad")
    off = next((line.strip() for line in calibration_lines(found) if "believed" in line), "")
    sentence = f"The range finder's frame was found: {off}. Accept it, or discard it, in the Cell tab."
    return replace(state, calibration=found).told(sentence, "good")


@dataclass(frozen=True)
class AcceptCalibration:
    """From now on the range finder is believed to stand where the calibration found it."""

    def apply(self, state: State) -> State:
        check_idle(state)
        if state.calibration is None or state.calibration.fit is None:
            raise BadInput("there is no calibration to accept; press Calibrate first.")
        session = calibrated(state.session, state.calibration.fit.T_world_range)
        return replace(_moved(state, "calibrate the range finder", session, ACCEPTED), calibration=None)


@dataclass(frozen=True)
class DiscardCalibration:
    def apply(self, state: State) -> State:
        return replace(state, calibration=None)


@dataclass(frozen=True)
class Misplace:
    """The simulated range finder is moved by some millimetres and turned, and nobody is told how far; or it stands where it should."""

    misplaced: bool

    def apply(self, state: State) -> State:
        check_idle(state)
        if not self.misplaced:
            session = with_finder_at(state.session, state.session.workcell.finder.T_world_range, np.eye(4))
            return _moved(state, "put the range finder back", session, BACK)
        rng = np.random.default_rng()  # hidden from the user too: no seed tells it
        xyz = rng.uniform(0.3, 1.0, 3) * rng.choice([-1.0, 1.0], 3) * MOST_OFF_M
        yaw = rng.uniform(0.3, 1.0) * rng.choice([-1.0, 1.0]) * MOST_TURN_RAD
        session = misplaced(state.session, from_xyz_rpy(xyz, (0.0, 0.0, float(yaw))))
        return _moved(state, "misplace the range finder", session, MISPLACED)


def _moved(state: State, label: str, session: Session, sentence: str) -> State:
    """The range finder stands elsewhere, or is believed to: said, with what went by it."""
    gone = f" {GONE}" if state.session.scene is not None or state.session.results else ""
    return replace(state.changed(label, session), playing=False).told(f"{sentence}{gone}")
