"""What arm, hand and held body touched in the simulated physics, and how hard: for benchmarks and checkers only."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Pair = tuple[int, int]


class Touches:
    """Keeps the greatest force [N] of every pair of bodies that met, one of which is of the robot or held by it. Not a value: it is fed at
    every step. `stood` are pairs that touch before anything moves: those a held body may part from without having run into them."""

    def __init__(self, is_robot: NDArray, pads: Iterable[int]) -> None:
        self._is_robot, self._pads = is_robot, tuple(pads)
        self._stood: set[frozenset[int]] = set()
        self._most: dict[Pair, float] = {}

    def stands(self, owners: NDArray) -> None:
        """The pairs of bodies (n, 2) that touch at the beginning."""
        self._stood = {frozenset(pair) for pair in owners.tolist()}

    def feel(self, owners: NDArray, efc_force: NDArray, efc_address: NDArray) -> None:
        """The contacts of one step, between bodies `owners` (n, 2), whose forces `normal_forces` tells."""
        robots: list[bool] = np.any(self._is_robot[owners], axis=1).tolist()
        if not any(robots):
            return
        pairs = owners.tolist()
        by_pad = [{other for pair in pairs if pad in pair for other in pair if other != pad} for pad in self._pads]
        held = set.intersection(*by_pad)
        for (a, b), of_robot, force in zip(pairs, robots, normal_forces(efc_force, efc_address).tolist(), strict=True):
            first, second = (b, a) if self._is_robot[b] or (b in held and not self._is_robot[a]) else (a, b)
            if of_robot or (first in held and frozenset((a, b)) not in self._stood):
                self._most[first, second] = max(force, self._most.get((first, second), 0.0))

    @property
    def most(self) -> dict[Pair, float]:
        """Greatest force by pair: what is of the robot, or was held, comes first."""
        return dict(self._most)


def normal_forces(efc_force: NDArray, efc_address: NDArray) -> NDArray:
    """The normal force (n,) [N] of contacts whose constraint rows begin at `efc_address` (n,), -1 for a contact without any."""
    return np.where(efc_address >= 0, efc_force[np.maximum(efc_address, 0)], 0.0) if len(efc_force) else np.zeros(len(efc_address))
