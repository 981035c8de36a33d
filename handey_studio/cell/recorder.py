"""Keeps samples of what the simulation measures while a motion runs."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.recording import SAMPLE_S, Event, Recording
from handey_studio.cell.simulation import Simulation


class Recorder:
    """Takes a sample of the simulation at each `SAMPLE_S`. Not a value: it lives as long as one motion."""

    def __init__(self, simulation: Simulation) -> None:
        self._sim = simulation
        self._every = round(SAMPLE_S / simulation.dt)
        self._steps = 0
        self._rows: list[tuple] = []
        self._events: list[Event] = []

    def sample(self, q_command: NDArray) -> None:
        """A step was done; every few of them are kept."""
        self._steps += 1
        if self._steps % self._every == 0:
            self._keep(q_command)

    def event(self, what: str) -> None:
        """Something was felt in this step."""
        self._events.append(Event(self._steps * self._sim.dt, what, float(np.linalg.norm(self._sim.wrench()[0]))))

    def recording(self, q_command: NDArray) -> Recording:
        """All that was kept, and where things are now."""
        if not self._rows or self._steps % self._every:
            self._keep(q_command)
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        return Recording(*columns, events=tuple(self._events))

    def _keep(self, q_command: NDArray) -> None:
        sim = self._sim
        self._rows.append((self._steps * sim.dt, sim.q.copy(), q_command, sim.opening, sim.finger_force, *sim.wrench()))
