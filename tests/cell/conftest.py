"""What the cell's tests share: the bundled library, its robot, and simple motions of the arm over the Figure 1 scene."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from handey_studio.cell.examples import figure1
from handey_studio.cell.geometric import GeometricCell
from handey_studio.geometry.transforms import transform
from handey_studio.motion import Trajectory
from handey_studio.world import Library, Robot, arm_of, load_robot
from handey_studio.world.library import bundled

AHEAD = np.deg2rad([0.0, -110.0, 110.0, -90.0, -90.0, 0.0])
OPEN = 0.09  # the bundled hand as wide as it goes [m]


@dataclass(frozen=True)
class PlainStep:
    """The least that the checker reads."""

    kind: str
    q_rad: NDArray
    time_s: NDArray
    hand_opening_m: NDArray
    held: str | None = None
    allowed_contacts: tuple[tuple[str, str], ...] = ()

    @property
    def motion(self) -> Trajectory:
        return Trajectory(self.time_s, self.q_rad, self.hand_opening_m)


@dataclass(frozen=True)
class Arms:
    """Motions of one robot, by IK alone: collisions are what the tests look for."""

    robot: Robot

    def at(self, T_world_hand: NDArray, near: NDArray) -> NDArray:
        arm = arm_of(self.robot)
        branches = np.array([arm.nearest_turns(q, near) for q in arm.ik(T_world_hand)])
        return branches[np.argmin(np.abs(branches - near).max(axis=1))]

    def line(self, start: NDArray, end: NDArray, near: NDArray, count: int = 25) -> NDArray:
        path = []
        for share in np.linspace(0, 1, count):
            T = start.copy()
            T[:3, 3] = (1 - share) * start[:3, 3] + share * end[:3, 3]
            near = self.at(T, near)
            path.append(near)
        return np.array(path)

    def step(self, kind: str, q: NDArray, opening, held: str | None = None, allowed=()) -> PlainStep:
        q = np.asarray(q, dtype=float)
        moves = (np.abs(np.diff(q, axis=0)) / self.robot.velocity).max(axis=1)
        openings = np.broadcast_to(np.asarray(opening, dtype=float), len(q))
        return PlainStep(kind, q, np.concatenate([[0.0], np.cumsum(np.maximum(moves, 0.01) * 1.01)]), openings, held, tuple(allowed))


def raised(T_world_hand: NDArray, height: float) -> NDArray:
    return transform(None, (0.0, 0.0, height)) @ T_world_hand


def over_l_block(T_world_part: NDArray, part_point) -> NDArray:
    """A hand that points down and closes along the L block's z, its tips' middle at a point of the part."""
    x = T_world_part[:3, 2]
    down = np.array([0.0, 0.0, -1.0])
    return transform(np.stack([x, np.cross(down, x), down], axis=1), T_world_part[:3, :3] @ part_point + T_world_part[:3, 3])


@pytest.fixture(scope="session")
def library() -> Library:
    return Library(Path(bundled()))


@pytest.fixture(scope="session")
def robot() -> Robot:
    return load_robot(bundled() / "robots" / "ur5")


@pytest.fixture(scope="session")
def arms(robot) -> Arms:
    return Arms(robot)


@pytest.fixture
def cell(library, robot) -> GeometricCell:
    """The Figure 1 cell, its arm turned from home to face the pile: straight joint lines from there pass over it."""
    cell = GeometricCell(figure1(), library)
    cell.follow(Trajectory(np.array([0.0, 2.0]), np.array([robot.home, AHEAD]), np.full(2, robot.hand.opening_max)))
    return cell
