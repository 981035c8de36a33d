"""The outside world: what a cell answers (`Cell`), and the workcell as data. The cells themselves are imported where they run."""

from handey_studio.cell.faults import Fault
from handey_studio.cell.protocol import TOUCH_N, CannotAct, Cell, Compliance, Moved, Wrench
from handey_studio.cell.recording import Event, Recording, Tracking, joined, tracking_error
from handey_studio.cell.workcell import SimulatedSetup, TrueBody, Workcell

__all__ = [
    "TOUCH_N",
    "CannotAct",
    "Cell",
    "Compliance",
    "Event",
    "Fault",
    "Moved",
    "Recording",
    "SimulatedSetup",
    "Tracking",
    "TrueBody",
    "Workcell",
    "Wrench",
    "joined",
    "tracking_error",
]
