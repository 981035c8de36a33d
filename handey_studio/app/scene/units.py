"""The scene's units: one unit is 100 mm, so that the browser's own camera keys fly by centimetres, not by metres."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handey_studio.geometry.transforms import from_xyz_rpy, to_wxyz

SCALE = 10.0


def at(T: NDArray) -> dict[str, NDArray]:
    """`wxyz` and `position` of a scene node that stands at a pose (4, 4) [m]."""
    return {"wxyz": to_wxyz(T), "position": T[:3, 3] * SCALE}


def place(handle, T: NDArray) -> None:
    """Move a scene node to a pose (4, 4) [m]."""
    handle.wxyz = to_wxyz(T)
    handle.position = T[:3, 3] * SCALE


def scaled(points: ArrayLike) -> NDArray:
    """Points [m] in scene units, float32."""
    return (np.asarray(points) * SCALE).astype(np.float32)


def metres(position: ArrayLike) -> NDArray:
    """A scene position in metres."""
    return np.asarray(position, dtype=float) / SCALE


UPRIGHT = from_xyz_rpy((0.0, 0.0, 0.0))
