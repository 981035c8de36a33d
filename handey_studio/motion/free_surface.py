"""The free regions of a configuration space as surfaces, to be looked at: all around them is forbidden."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handey_studio.motion.results import CSpaceSummary

MOST_CELLS = 40  # a side; a finer space is shown coarser

# The corners of a cell's sides towards +x, +y and +z, counter-clockwise seen from there, from the cell's lowest corner.
SIDES = np.array(
    [
        [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]],
        [[0, 1, 0], [0, 1, 1], [1, 1, 1], [1, 1, 0]],
        [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    ]
)
Surface = tuple[NDArray, NDArray]  # corners (n, 3), shares of each joint's range from 0 to 1, and triangles (k, 3), outward


def free_surfaces(space: CSpaceSummary, most: int = MOST_CELLS) -> tuple[Surface, Surface]:
    """The surface of the free regions that the free leg runs in, and that of the others.

    A space of more than `most` cells a side is shown by blocks of cells, a block as free when any of it is.
    """
    regions = np.zeros(space.blocked.shape, np.int32)
    ndimage.label(~space.blocked, structure=np.ones((3, 3, 3)), output=regions)
    used = np.isin(regions, regions[tuple(space.path_cells.T)]) & ~space.blocked
    return _surface(_coarser(used, most)), _surface(_coarser(~space.blocked & ~used, most))


def shares(space: CSpaceSummary, q: NDArray) -> NDArray:
    """Where the arm joints of configurations (..., n) [rad] lie in the ranges of the space (..., 3), from 0 to 1; an angle beyond a range
    counts where a whole turn brings it into it, else at its end."""
    found = []
    for joint, centres in zip(space.joints, space.centres, strict=True):
        low, high = centres[0] - space.step_rad / 2, centres[-1] + space.step_rad / 2
        angle = np.asarray(q)[..., joint]
        angle = angle - 2 * np.pi * np.ceil((angle - high) / (2 * np.pi)) * (angle > high)
        angle = angle + 2 * np.pi * np.ceil((low - angle) / (2 * np.pi)) * (angle < low)
        found.append(np.clip((angle - low) / (high - low), 0.0, 1.0))
    return np.stack(found, axis=-1)


def _surface(cells: NDArray) -> Surface:
    """The surface of a set of cells (n1, n2, n3), the space's ends included."""
    padded = np.pad(cells, 1)
    quads = []
    for axis, side in enumerate(SIDES):
        ahead = np.roll(padded, -1, axis=axis)
        upper, lower = np.argwhere(padded & ~ahead) - 1, np.argwhere(ahead & ~padded) - 1
        quads += [upper[:, None] + side, lower[:, None] + side[::-1]]
    corners, number = np.unique(np.concatenate(quads).reshape(-1, 3), axis=0, return_inverse=True)
    number = number.reshape(-1, 4)
    return corners / np.array(cells.shape), np.concatenate([number[:, [0, 1, 2]], number[:, [0, 2, 3]]])


def _coarser(cells: NDArray, most: int) -> NDArray:
    """Blocks of cells, True where any of a block is; as they are where they are few enough."""
    by = -(-np.array(cells.shape) // most)
    grown = np.pad(cells, [(0, int(n)) for n in -np.array(cells.shape) % by])
    sizes = [size for pair in zip(np.array(grown.shape) // by, by, strict=True) for size in pair]
    return np.asarray(grown.reshape(sizes).any(axis=(1, 3, 5)))
