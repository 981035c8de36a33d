"""Where the hand shows the calibration cube: the paper's three poses (Handey 1987 §6), and places all over the map."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.cell.protocol import CannotAct
from handey_studio.geometry.transforms import apply, transform
from handey_studio.sensing.stripes.range_finder import RangeFinder

SPARE_M = 0.05  # that the range frame may be off before the cube leaves the map
UNDER_M = 0.02  # kept above what stands on the table
LOWEST_M, RISE_M, ROOF_M = 0.12, 0.04, 0.03  # of the hand above the table, from the lowest to the highest pose, below the scan's ceiling
YAWS_DEG = (70.0, 110.0, 250.0, 290.0, 20.0, 160.0)  # of the hand: inclined to the map's cells, whose steps then even out along an edge
PLACES_A_POSE = 3


class Stage(NamedTuple):
    """Where the hand may be: `middle` (3,) [m] of it in the world, at the lowest, and how far (2,) [m] along x and y from there."""

    middle: NDArray
    reach: NDArray


def stage_of(finder: RangeFinder, table_z: float, top: float, side: float) -> Stage:
    """The room for a cube of a side [m] above things that stand up to `top` [m] on the table. Raises `CannotAct` when there is none."""
    reach = np.array(finder.area) / 2 - side - SPARE_M
    lowest = max(LOWEST_M, top + UNDER_M + side)
    ceiling = finder.max_height + finder.T_world_range[2, 3] - table_z - side / 2 - ROOF_M - RISE_M
    if reach.min() < side / 2 or lowest > ceiling:
        raise CannotAct(
            f"there is no room to show a cube of {1e3 * side:.0f} mm: the hand would be {1e3 * lowest:.0f} mm above the table, the "
            f"range finder sees up to {1e3 * ceiling:.0f} mm, and from the map's middle it could move by {1e3 * reach.min():.0f} mm."
        )
    middle = apply(finder.T_world_range, (finder.area[0] / 2, finder.area[1] / 2, 0.0))
    return Stage(np.array([middle[0], middle[1], table_z + lowest]), reach)


def three_hands(stage: Stage, yaw_deg: float) -> Iterator[NDArray]:
    """A pose (4, 4) of the hand, the same moved along the robot's x, and that turned by π."""
    for x, turn in ((-stage.reach[0], 0.0), (stage.reach[0], 0.0), (stage.reach[0], 180.0)):
        yield level_hand(stage.middle + np.array([x, 0.0, RISE_M / 2]), yaw_deg + turn)


def other_hands(stage: Stage, poses: int, seed: int) -> Iterator[NDArray]:
    """Poses (4, 4) all over the map, at several heights, the hand one way and the other; more than are asked for, as some may fail."""
    rng = np.random.default_rng(seed)
    for k in range(PLACES_A_POSE * poses):
        place = stage.middle + np.append(rng.uniform(-stage.reach, stage.reach), rng.uniform(0.0, RISE_M))
        yield level_hand(place, YAWS_DEG[k % 4] + rng.uniform(-10.0, 10.0))


def level_hand(place: NDArray, yaw_deg: float) -> NDArray:
    """T_world_hand (4, 4): level, pointing along a heading, the fingers side by side."""
    z, up = np.array([np.cos(np.deg2rad(yaw_deg)), np.sin(np.deg2rad(yaw_deg)), 0.0]), np.array([0.0, 0.0, 1.0])
    return transform(np.stack([np.cross(up, z), up, z], axis=1), place)
