"""A quick cell with one brick, and a cell that gets into trouble when told to: the planner knows nothing of either."""

from dataclasses import replace

import numpy as np

from handey_studio.cell.geometric import GeometricCell
from handey_studio.cell.protocol import Moved
from handey_studio.cell.workcell import SimulatedSetup, TrueBody, Workcell
from handey_studio.geometry.transforms import from_xyz_rpy, transform
from handey_studio.motion import Trajectory
from handey_studio.sensing.stripes.range_finder import RangeFinder
from handey_studio.task import MoveCommand, MoveOptions, RecoveryOptions, Station, run_move
from handey_studio.world import Library

LIBRARY = Library.choose()
AREA = (0.30, 0.34)
COMMAND = MoveCommand("brick", "0.48,0.08,0.015,0,0,60")
GOAL = from_xyz_rpy((0.48, 0.08, 0.015), np.deg2rad((0.0, 0.0, 60.0)))


def workcell() -> Workcell:
    """One brick on an empty table, in the view of a coarse range finder."""
    finder = RangeFinder(transform(None, (0.33, -0.17, 0.0)), AREA, planes=700)
    brick = TrueBody("brick", from_xyz_rpy((0.46, -0.08, 0.015), (0.0, 0.0, 0.4)), part="brick")
    return Workcell("ur5", ("brick",), finder=finder, setup=SimulatedSetup((brick,), physics=False))


class Troubled(GeometricCell):
    """`trouble` names what goes wrong, `times` how often."""

    def __init__(self, trouble: str = "", times: int = 1) -> None:
        super().__init__(workcell(), LIBRARY)
        self.trouble, self.left, self.scans, self.carried = trouble, times, 0, 0

    def _comes(self, trouble: str) -> bool:
        now = self.trouble == trouble and self.left > 0
        self.left -= now
        return now

    def scan(self):
        self.scans += 1
        if self.scans == 2 and self._comes("moved"):
            self.nudge((0.0, 0.03, 0.0))
        return super().scan()

    def follow(self, motion: Trajectory) -> Moved:
        self.carried = self.carried + 1 if self.held_truly() else 0
        transfers = self.carried == 2  # the lift comes first
        if transfers and self._comes("dropped"):
            super().grip(self.opening() + 0.004)
            super().grip(self._robot.hand.opening_min)
        if transfers and self._comes("blocked"):
            half = len(motion.time_s) // 2
            stopped = super().follow(Trajectory(motion.time_s[:half], motion.q_rad[:half], motion.hand_opening_m[:half]))
            return Moved("blocked", stopped.recording)
        return super().follow(motion)

    def descend(self, motion: Trajectory, until_N: float = 5.0) -> Moved:
        if self._comes("early contact"):
            half = len(motion.time_s) // 2
            touched = super().follow(Trajectory(motion.time_s[:half], motion.q_rad[:half], motion.hand_opening_m[:half]))
            return Moved("contact", touched.recording)
        return super().descend(motion, until_N)

    def grip(self, opening: float, force_N: float | None = None) -> Moved:
        away = np.abs(self.joints() - self._robot.home).max() > 0.05
        closes = opening < self.opening() and self.held_truly() is None and away
        if closes and self._comes("missed"):
            self._opening = opening
            return Moved("arrived", self._still())
        if self.held_truly() is not None and opening > self.opening() and self._comes("hand stuck"):
            return Moved("contact", self._still())
        lets_go = self.held_truly() is not None and opening > self.opening()
        moved = super().grip(opening, force_N)
        if lets_go and self._comes("wrong place"):
            self.nudge((0.006, 0.0, 0.0))
        return moved

    def nudge(self, by: tuple[float, float, float]) -> None:
        """The brick is pushed over the table."""
        body = next(body for body in self.true_scene() if body.name == "brick")
        self._replace([body.at(transform(None, by) @ body.T_world_body)])


def station() -> Station:
    cell = workcell()
    return Station(replace(cell, setup=SimulatedSetup()), LIBRARY.robot("ur5"), (LIBRARY.part("brick"),))


def moved(cell: GeometricCell, attempts: int = 3, command: MoveCommand = COMMAND):
    """The outcome of the MOVE in a cell."""
    return run_move(station(), cell, command, MoveOptions(seed=1), recovery=RecoveryOptions(attempts=attempts))
