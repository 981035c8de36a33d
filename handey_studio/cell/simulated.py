"""The simulated cell of a workcell: with forces or without, as its setup says."""

from handey_studio.cell.geometric import GeometricCell
from handey_studio.cell.physics.physical import PhysicalCell
from handey_studio.cell.workcell import Workcell
from handey_studio.world.library import Library

SimulatedCell = GeometricCell | PhysicalCell


def simulated_cell(workcell: Workcell, library: Library) -> SimulatedCell:
    """The cell that answers for a workcell. Raises BadInput for a setup that makes no sense."""
    return (PhysicalCell if workcell.setup.physics else GeometricCell)(workcell, library)
