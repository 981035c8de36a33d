"""What every simulated cell has: a true state that the planner never sees, and a range finder that photographs it."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.base.errors import unknown_name
from handey_studio.cell.bodies import SolidBody, check_names, fixed_bodies, solid_body
from handey_studio.cell.faults import Fault, check_faults
from handey_studio.cell.in_view import arm_bodies
from handey_studio.cell.physics.settling import settle
from handey_studio.cell.stripes import photograph
from handey_studio.cell.workcell import SimulatedSetup, Workcell
from handey_studio.geometry import box
from handey_studio.geometry.transforms import apply, inverse, transform
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.world.arm import arm_of
from handey_studio.world.library import Library


class TrueState(ABC):
    """The part of a simulated cell that knows the truth. Not a value: it lives in the process that executes.

    The range finder photographs all that really stands there, the arm and what it holds among it when it reaches into the scan's space.
    """

    def __init__(self, workcell: Workcell, library: Library) -> None:
        self._setup, self._finder = workcell.setup, workcell.finder
        self._robot = library.robot(workcell.robot)
        self._arm = arm_of(self._robot)
        self._scans = 0
        names = [body.name for body in workcell.setup.bodies]
        check_faults(workcell.setup.faults, names, self._arm.n)
        if workcell.setup.held is not None and workcell.setup.held not in names:
            raise unknown_name("body", workcell.setup.held, names)

    @abstractmethod
    def joints(self) -> NDArray: ...

    @abstractmethod
    def opening(self) -> float: ...

    @abstractmethod
    def true_scene(self) -> tuple[SolidBody, ...]:
        """All bodies where they really are. Only benchmarks and checkers may ask; a planner that does is cheating."""

    @abstractmethod
    def held_truly(self) -> str | None:
        """Name of the true body in the hand, for benchmarks and checkers only."""

    def scan(self) -> DepthMap:
        return self._photograph(np.zeros(3))

    def true_pose(self, name: str) -> NDArray:
        """T_world_body (4, 4) as it really is. Only benchmarks and checkers may ask; a planner that does is cheating."""
        bodies = self.true_scene()
        for body in bodies:
            if body.name == name:
                return body.T_world_body
        raise unknown_name("body", name, [body.name for body in bodies])

    def setup_now(self) -> SimulatedSetup:
        """The true state as a setup, so that a session can go on from it. What the hand still holds falls from there until it rests."""
        now = {body.name: body.T_world_body for body in self.true_scene()}
        bodies = tuple(replace(body, T_world_body=now[body.name]) for body in self._setup.bodies)
        return replace(self._setup, bodies=bodies, drop=self.held_truly() is not None, held=None)

    def _photograph(self, bias: NDArray) -> DepthMap:
        """One sweep from where the finder really stands, told as from where it is said to stand, and shifted by `bias` (3,) [m]."""
        rng = np.random.default_rng([self._setup.seed, self._scans])
        self._scans += 1
        said, really = self._finder.T_world_range, self._setup.T_range_offset @ self._finder.T_world_range
        bodies = (*self.true_scene(), *self._arm_in_view())
        seen = photograph(replace(self._finder, T_world_range=really), bodies, rng)
        return replace(seen, T_world_range=transform(translation=bias) @ said)

    def _arm_in_view(self) -> tuple[SolidBody, ...]:
        """Links and hand, if any of them reaches over the scan's area."""
        bodies = arm_bodies(self._arm, self.joints(), self.opening())
        T_range_world = inverse(self._finder.T_world_range)
        corners = np.concatenate([apply(T_range_world, body.corners_world) for body in bodies])[:, :2]
        return bodies if ((corners > 0) & (corners < self._finder.area)).all(axis=1).any() else ()


def true_bodies(workcell: Workcell, library: Library) -> tuple[SolidBody, ...]:
    """The true scene of a workcell: table, known blocks, and the setup's bodies, dropped when the setup says so."""
    bodies = (*fixed_bodies(workcell), *(solid_body(body, library.part) for body in workcell.setup.bodies))
    check_names(bodies)
    return settle(bodies).bodies if workcell.setup.drop else bodies


def obstacles(faults: Sequence[Fault]) -> tuple[SolidBody, ...]:
    """The bodies that faults bring in, in the faults' order."""
    found = [fault for fault in faults if fault.kind == "obstacle"]
    return tuple(SolidBody(f"obstacle{k + 1}", box(fault.vector), fault.T_world_body, fixed=True) for k, fault in enumerate(found))
