"""Scans: looks at an object on its support, from the cell's depth map or from files."""

import os
from dataclasses import dataclass, replace

import numpy as np

from handey_studio.base import BadInput, Value
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.depth_view import DepthView
from handey_studio.sensing.reading.files import DepthReading, read_depth
from handey_studio.sensing.support import support_plane

CELL_SCAN = "range finder"  # the source of the cell's own scans


@dataclass(frozen=True, eq=False)
class Scan(Value):
    """One look at the object. `view.T_world_sensor` puts the support plane at z = 0, z up; `source` tells where it came from."""

    name: str
    view: DepthView
    source: str = ""


def scan_of_map(name: str, depth_map: DepthMap) -> Scan:
    """The cell's depth map as a scan: seen from above by parallel light, in the cell's world."""
    return Scan(name, depth_map.view(), CELL_SCAN)


def scan_of_view(name: str, view: DepthView, source: str, rng: np.random.Generator | None = None) -> Scan:
    """A view whose world is not known: its support plane becomes z = 0. Raises BadInput when it shows none."""
    support = support_plane(view, np.random.default_rng(0) if rng is None else rng)
    if not support.found:
        raise BadInput(f'scan "{name}" shows no support: {support.reason}; the plane that the object stands on must be in view.')
    return Scan(name, replace(view, T_world_sensor=support.T_world_sensor), source)


def read_scan(
    name: str,
    depth_path: str | os.PathLike,
    camera_path: str | os.PathLike | None = None,
    cloud_unit: str = "m",
    rng: np.random.Generator | None = None,
) -> Scan:
    """A scan from files, as `sensing.files.read_depth` reads them; the support is found where the file does not tell its world.

    Raises BadInput with one sentence.
    """
    return scan_of_reading(name, read_depth(depth_path, camera_path, cloud_unit), os.fspath(depth_path), rng)


def scan_of_reading(name: str, reading: DepthReading, source: str, rng: np.random.Generator | None = None) -> Scan:
    """What was read from a file as a scan; the support is found where the file does not tell its world. Raises BadInput."""
    return Scan(name, reading.view, source) if reading.knows_world else scan_of_view(name, reading.view, source, rng)
