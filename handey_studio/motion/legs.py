"""The legs from the start, and from the goal, to the free space: the arm as it is, the wrist as it is (Handey 1987 §4)."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.motion.certificate import Mover
from handey_studio.motion.layers import Layers
from handey_studio.motion.regions import nearest_cells

TRIES = 40


def leg_to_free(mover: Mover, layers: Layers, layer: int, q: NDArray, region: int) -> tuple[NDArray, NDArray] | None:
    """A proved straight way (2, joints) from q to the centre of a free cell of a region in one layer, and that cell (4,).

    The nearest cells are tried first; None when none of them is reached.
    """
    space = layers.spaces[layer]
    for cell in nearest_cells(layers.regions, layer, space.place(q), region, TRIES):
        end = space.at(cell, q)
        if mover.moves(q, end):
            return np.array([q, end]), np.array([layer, *cell])
    return None
