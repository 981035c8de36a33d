"""What a user sets and can take back: every change of it is one step of undo."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.faults import Fault
from handey_studio.cell.workcell import SimulatedSetup
from handey_studio.modeling.draft import Draft
from handey_studio.session import Session
from handey_studio.session.command_list import with_commands
from handey_studio.task.plan import MoveCommand

Pose = tuple[float, ...]  # the 16 numbers of a transform, row by row


@dataclass(frozen=True)
class Settings:
    """What the user sets and can take back: the MOVE commands, how they are planned and tried, the robot, whether the simulated cell obeys
    forces and what goes wrong in it on purpose, where the range finder is taken to stand, and the part that is being modelled."""

    commands: tuple[MoveCommand, ...]
    seed: int
    robot: str
    draft: Draft | None = None
    attempts: int = 3
    improve: int = 0
    physics: bool = False
    faults: tuple[Fault, ...] = ()
    finder: Pose = ()
    offset: Pose = ()

    @classmethod
    def of(cls, session: Session) -> "Settings":
        workcell = session.workcell
        how = session.attempts, session.improve, workcell.setup.physics, workcell.setup.faults
        where = _numbers(workcell.finder.T_world_range), _numbers(workcell.setup.T_range_offset)
        return cls(session.commands, session.seed, workcell.robot, session.draft, *how, *where)

    def put_into(self, session: Session) -> Session:
        session = replace(with_commands(session, self.commands), seed=self.seed, draft=self.draft)
        session = replace(session, attempts=self.attempts, improve=self.improve)
        session = with_finder_at(session, _transform(self.finder), _transform(self.offset))
        return with_robot(with_disturbances(session, self.physics, self.faults), self.robot)


def with_robot(session: Session, robot: str) -> Session:
    """The session with another robot in its workcell: what was planned for the one before goes, what was scanned stays."""
    if robot == session.workcell.robot:
        return session
    view = replace(session.view, time_s=0.0, result=-1)
    return replace(session, workcell=replace(session.workcell, robot=robot), results=(), view=view)


def with_disturbances(session: Session, physics: bool, faults: tuple[Fault, ...]) -> Session:
    """The session whose simulated cell obeys forces or not, and in which this goes wrong on purpose; its bodies stay where they are."""
    before = session.workcell.setup
    if (before.physics, before.faults) == (physics, faults):
        return session
    now = None if session.cell_now is None else replace(session.cell_now, physics=physics, faults=faults)
    workcell = replace(session.workcell, setup=replace(before, physics=physics, faults=faults))
    return replace(session, workcell=workcell, cell_now=now)


def with_finder_at(session: Session, T_world_range: NDArray, T_range_offset: NDArray) -> Session:
    """The session whose range finder is believed to stand there, and in the simulated cell really stands off by the second transform
    (both (4, 4)). What was seen by another belief goes."""
    workcell = session.workcell
    if np.array_equal(workcell.finder.T_world_range, T_world_range) and np.array_equal(workcell.setup.T_range_offset, T_range_offset):
        return session

    def moved(setup: SimulatedSetup) -> SimulatedSetup:
        return replace(setup, T_range_offset=T_range_offset)

    now = None if session.cell_now is None else moved(session.cell_now)
    finder = replace(workcell.finder, T_world_range=T_world_range)
    return replace(session.without_findings(), cell_now=now, workcell=replace(workcell, finder=finder, setup=moved(workcell.setup)))


def _numbers(T: NDArray) -> Pose:
    return tuple(T.ravel().tolist())


def _transform(numbers: Pose) -> NDArray:
    return np.array(numbers).reshape(4, 4)
