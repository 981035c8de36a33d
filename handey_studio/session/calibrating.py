"""A session whose range finder is calibrated: the cube put into the simulated hand, and what was found put into the workcell."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.simulated import SimulatedCell, simulated_cell
from handey_studio.cell.workcell import SimulatedSetup, TrueBody
from handey_studio.geometry.transforms import inverse, transform
from handey_studio.session.session import Session
from handey_studio.task.calibrating.calibrate import CUBE, cube_in_hand
from handey_studio.world import Library, arm_of

OFF_CENTRE_M = 0.003  # a person puts the cube about so far beside where it is said to be


def cell_with_cube(session: Session, library: Library, side: float) -> SimulatedCell:
    """The session's cell with a cube in its hand, aligned with it; where exactly, only the cell knows."""
    setup = session.cell_now or session.workcell.setup
    if setup.drop:  # what falls has fallen before the cube is put into the hand
        setup = simulated_cell(replace(session.workcell, setup=setup), library).setup_now()
    off = np.random.default_rng([setup.seed, 6]).uniform(-OFF_CENTRE_M, OFF_CENTRE_M, 2)
    robot = library.robot(session.workcell.robot)
    T_world_cube = arm_of(robot).hand_pose(robot.home) @ cube_in_hand(side) @ transform(None, (0.0, *off))
    cube = TrueBody(CUBE, T_world_cube, size=np.full(3, side))
    holding = replace(setup, bodies=(*setup.bodies, cube), held=CUBE)
    return simulated_cell(replace(session.workcell, setup=holding), library)


def misplaced(session: Session, T_range_offset: NDArray) -> Session:
    """The session whose simulated range finder really stands off by a transform (4, 4) from where it is believed to stand."""
    return _with_setups(session, lambda setup: replace(setup, T_range_offset=T_range_offset))


def calibrated(session: Session, T_world_range: NDArray) -> Session:
    """The session whose range finder is believed to stand at `T_world_range` (4, 4) from now on. It stays where it really stands, and what
    was seen by the old belief goes."""
    finder = session.workcell.finder
    moved = finder.T_world_range @ inverse(T_world_range)
    session = _with_setups(session, lambda setup: replace(setup, T_range_offset=setup.T_range_offset @ moved))
    return replace(session, workcell=replace(session.workcell, finder=replace(finder, T_world_range=T_world_range)))


def really_at(session: Session) -> NDArray:
    """T_world_range (4, 4) as it truly is in the simulated cell: what a calibration is held against when it is over."""
    setup: SimulatedSetup = session.cell_now or session.workcell.setup
    return setup.T_range_offset @ session.workcell.finder.T_world_range


def _with_setups(session: Session, changed) -> Session:
    now = None if session.cell_now is None else changed(session.cell_now)
    session = session.without_findings()
    return replace(session, cell_now=now, workcell=replace(session.workcell, setup=changed(session.workcell.setup)))
