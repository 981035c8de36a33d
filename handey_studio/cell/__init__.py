"""The outside world: what a cell answers (`Cell`), and the workcell as data. The cells themselves are imported where they run."""

from handey_studio.cell.protocol import CannotAct, Cell, Moved
from handey_studio.cell.workcell import SimulatedSetup, TrueBody, Workcell

__all__ = ["CannotAct", "Cell", "Moved", "SimulatedSetup", "TrueBody", "Workcell"]
