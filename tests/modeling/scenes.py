"""Objects on a table whose shape is known, as scans: by a depth camera in closed form, or by the range finder from above."""

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry import Polyhedron
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.modeling.scans import Scan, scan_of_map
from handey_studio.sensing.depth_view import DepthView, Pinhole
from tests.localization.boxes import depth_of
from tests.localization.rendering import looking_at, map_from_above

PINHOLE = Pinhole(525.0, 525.0, 319.5, 239.5)
SHAPE = (480, 640)
EYE = np.array([0.25, -0.6, 0.55])


def box_pose(size, yaw: float = 0.0, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> NDArray:
    """T_world_box of a box that stands at x, y, turned by `yaw` [rad], its bottom at z [m]."""
    return from_xyz_rpy((x, y, z + 0.5 * size[2]), (0.0, 0.0, yaw))


def boxes_seen(boxes, rng: np.random.Generator, noise: float = 0.0015, eye: NDArray = EYE, lost: float = 0.0) -> Scan:
    """A scan of boxes (size, T_world_box) on the table; `lost` is the share of readings that are missing at random."""
    T = looking_at(eye, np.array([0.0, 0.0, 0.05]))
    depth = depth_of(boxes, PINHOLE, T, SHAPE)
    depth = depth + rng.normal(0.0, noise, SHAPE)
    depth[rng.random(SHAPE) < lost] = np.nan
    pixel = float(np.nanmedian(depth)) / PINHOLE.fx
    return Scan("camera", DepthView(depth, PINHOLE, T, noise, pixel))


def part_seen(solid: Polyhedron, T_world_part: NDArray, rng: np.random.Generator, noise: float = 0.0005) -> Scan:
    """A scan of one part by the range finder."""
    return scan_of_map("finder", map_from_above([(solid, T_world_part)], rng, noise=noise))
