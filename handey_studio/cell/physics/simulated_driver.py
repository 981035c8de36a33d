"""The simulated arm as a driver: physics behind the same door as a real arm, and the faults that a setup asks for."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.driver import Drive, Reference
from handey_studio.cell.faults import Call, Fault
from handey_studio.cell.physics.fault_clock import FaultClock
from handey_studio.cell.physics.simulation import Simulation
from handey_studio.world.arm import Arm

CALM_S, CALM_SPEED, CALM_TURN = 2.0, 0.002, 0.05  # bodies slower than this [m/s, rad/s] are at rest; waited for no longer than this [s]


class SimulatedDriver(Simulation):
    """The simulation, stepped by the controller. Faults begin and end by its own clock; `obstacles` belong to those that bring one."""

    def __init__(self, arm: Arm, bodies: Sequence[SolidBody], faults: Sequence[Fault], obstacles: Sequence[SolidBody]) -> None:
        super().__init__(arm, bodies, obstacles)
        self._clock, self._now = FaultClock(faults), 0.0
        self._brings = [number for number, fault in enumerate(faults) if fault.kind == "obstacle"]
        self._shoved: dict[int, str] = {}

    def begin(self, call: Call) -> None:
        self._clock.called(call, self._now)

    def tick(self, to: Reference, fingers: Drive) -> None:
        for number, fault, on in self._clock.changes(self._now):
            self._switch(number, fault, on)
        if any(fault.kind == "stuck" and self.opening <= fault.size for _, fault in self._clock.on(self._now)):
            self.jam(self.finger_dofs, True)
        self.step(to, fingers)
        self._now += self.dt

    def scan_bias(self) -> NDArray:
        """By how much (3,) [m] scans are shifted now."""
        return np.sum([np.zeros(3), *(fault.vector for _, fault in self._clock.on(self._now) if fault.kind == "bias")], axis=0)

    def wait_for_rest(self, to: Reference, fingers: Drive) -> None:
        """Hold the arm until the bodies are at rest, one tick at least."""
        for _ in range(int(CALM_S / self.dt)):
            self.tick(to, fingers)
            if self.calm(CALM_SPEED, CALM_TURN):
                return

    def _switch(self, number: int, fault: Fault, on: bool) -> None:
        """A fault begins or ends."""
        if fault.kind == "obstacle":
            self.appear(self._brings.index(number), on)
        elif fault.kind == "blocked":
            self.jam(self.arm_dofs[[int(fault.size)]], on)
        elif fault.kind == "stuck" and not on:
            self.jam(self.finger_dofs, False)
        elif fault.kind in ("slip", "push"):
            self._switch_on_body(number, fault, on)

    def _switch_on_body(self, number: int, fault: Fault, on: bool) -> None:
        """A fault of a body, or of whatever the hand holds when it begins."""
        name = self._shoved.get(number) or fault.body or self.held()
        if name is None:
            return
        self._shoved[number] = name
        if fault.kind == "slip":
            self.rub(name, fault.size if on else 1.0)
        else:
            self.push(name, fault.vector if on else np.zeros(3))
