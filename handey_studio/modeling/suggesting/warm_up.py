"""Compiled code made ready before anyone waits for it."""

import numpy as np

from handey_studio.modeling.scans import Scan
from handey_studio.modeling.suggesting.suggest import suggest
from handey_studio.sensing.depth_view import DepthView, Orthographic, Pinhole

HEIGHT_M = 0.5


def warm_up() -> None:
    """Suggests a solid for a small step on a table, seen by either kind of sensor: compiles what patches and suggestions need."""
    depth = np.full((60, 60), HEIGHT_M)
    depth[18:42, 18:42] -= 0.03
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[2, 3] = HEIGHT_M
    for projection in (Pinhole(500.0, 500.0, 30.0, 30.0), Orthographic(0.001, 30.0, 30.0)):
        suggest([Scan("warm-up", DepthView(depth, projection, T, 0.0005, 0.001))])
