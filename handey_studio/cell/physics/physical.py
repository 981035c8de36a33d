"""The simulated cell with forces: arm and hand under control, parts that fall, slip and tip, grips by friction alone."""

import numpy as np

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.controlled import ControlledCell
from handey_studio.cell.gripping import span_between
from handey_studio.cell.physics.simulated_driver import SimulatedDriver
from handey_studio.cell.truth import TrueState, obstacles, true_bodies
from handey_studio.cell.workcell import Workcell
from handey_studio.geometry.transforms import inverse
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.world.library import Library


class PhysicalCell(ControlledCell, TrueState):
    """A simulated cell in which everything obeys forces. The same calls on the same setup give the same numbers.

    Time passes in motions, and before a scan until the bodies are at rest.
    """

    def __init__(self, workcell: Workcell, library: Library) -> None:
        TrueState.__init__(self, workcell, library)
        bodies, faults = true_bodies(workcell, library), workcell.setup.faults
        self._simulated = SimulatedDriver(self._arm, bodies, faults, obstacles(faults))
        hand, held = self._robot.hand, workcell.setup.held
        opening = hand.opening_max if held is None else self._width(bodies, held)
        self._simulated.place(self._robot.home, opening, 0.0 if held is None else hand.force)
        ControlledCell.__init__(self, self._robot, self._simulated, self._sweep)

    def true_scene(self) -> tuple[SolidBody, ...]:
        return self._simulated.true_bodies()

    def held_truly(self) -> str | None:
        return self._simulated.held()

    def touched_truly(self) -> dict[tuple[str, str], float]:
        """What of the robot (`link3`, `hand`, `finger_left` …), or which body in its hand, has touched which body so far, and how hard at
        most [N]; for benchmarks and checkers only. What the held body stood against at the start is left out."""
        return self._simulated.touched()

    def _sweep(self) -> DepthMap:
        """What the range finder sees once everything is at rest."""
        bias = self._simulated.scan_bias()
        self._simulated.wait_for_rest(self._standing(), self._drive)
        return self._photograph(bias)

    def _width(self, bodies: tuple[SolidBody, ...], name: str) -> float:
        """How far the fingers are open [m] around a body that the hand holds at home."""
        body = next(body for body in bodies if body.name == name)
        T_hand_body = inverse(self._arm.hand_pose(self._robot.home)) @ body.T_world_body
        span = span_between(self._robot.hand, T_hand_body, body, self._robot.hand.opening_max)
        return float(np.diff(span)[0]) if span is not None else 0.0
