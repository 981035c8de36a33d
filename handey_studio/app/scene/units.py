"""The scene's units: one unit is 100 mm, so that the browser's own camera keys fly by centimetres, not by metres."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handey_studio.geometry.transforms import to_wxyz

SCALE = 10.0


def place(handle: Any, T: NDArray) -> None:
    """Move a scene node to a pose (4, 4) [m]."""
    handle.wxyz = to_wxyz(T)
    handle.position = T[:3, 3] * SCALE


def scaled(points: ArrayLike) -> NDArray:
    """Points [m] in scene units, float32."""
    return (np.asarray(points) * SCALE).astype(np.float32)


def metres(position: ArrayLike) -> NDArray:
    """A scene position in metres."""
    return np.asarray(position, dtype=float) / SCALE
