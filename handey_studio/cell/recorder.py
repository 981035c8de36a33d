"""Keeps samples of what a driver measures while a motion runs."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.driver import Driver
from handey_studio.cell.recording import SAMPLE_S, Event, Recording


class Recorder:
    """Takes a sample at each `SAMPLE_S`, and at the end. Not a value: it lives as long as one motion."""

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self._every = max(1, round(SAMPLE_S / driver.dt))
        self._ticks = 0
        self._rows: list[tuple] = []
        self._events: list[Event] = []

    def sample(self, q_command: NDArray) -> None:
        """A tick was done; every few of them are kept."""
        self._ticks += 1
        if self._ticks % self._every == 0:
            self._keep(q_command)

    def event(self, what: str) -> None:
        """Something was felt in this tick."""
        self._events.append(Event(self._ticks * self._driver.dt, what, float(np.linalg.norm(self._driver.wrench()[0]))))

    def recording(self, q_command: NDArray) -> Recording:
        """All that was kept, and where things are now."""
        if not self._rows or self._ticks % self._every:
            self._keep(q_command)
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        return Recording(*columns, events=tuple(self._events))

    def _keep(self, q_command: NDArray) -> None:
        driver = self._driver
        row = (self._ticks * driver.dt, np.array(driver.q), q_command, driver.opening, driver.finger_force, *driver.wrench())
        self._rows.append(row)
