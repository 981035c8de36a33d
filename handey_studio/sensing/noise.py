"""The noise of a depth image, measured from itself: how far its readings lie off the planes that they belong to.

Windows all over the image are fitted with planes. Steps, creases and curved surfaces leave large residuals, so the answer is what the
better windows say. Sensors that smooth have errors that neighbours share: in a small window the plane follows them. How much
more a larger window shows than a smaller one tells that, and by as much again the noise is taken larger.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.sensing.depth_view import Orthographic, Pinhole
from handey_studio.sensing.windows import fit_windows, window_corners

SIDES_PX = (7, 11, 17)  # of the windows
WINDOWS = 450  # of each size; more tell no more
MIN_WINDOWS = 12
MIN_FILLED = 0.5  # of a window's pixels
BETTER_SHARE = 0.3  # this quantile of the windows' residuals is taken for the noise: a part of them holds more than one plane
BEST_SHARE = 0.1  # this one to compare windows of two sizes
MAX_SHARED = 1.35  # how much larger than the largest windows' residuals the noise can be
LEAST_M = 0.00015  # exact depth, as renderers make it, still has edges that are a pixel off
MOST_M = 0.02
UNKNOWN_SHARE = 0.002  # of the depth, where there is too little to measure: a depth camera's usual noise
GROWTH_RATIO = 1.15  # depths must differ by so much to tell how noise depends on depth


@dataclass(frozen=True)
class Noise:
    """`sigma` [m]: the standard deviation of a reading on a plane at the view's median depth. It changes as depth to the power of
    `growth`: 2 for sensors that triangulate, 0 for noise that is the same everywhere. `windows` were good enough to measure it."""

    sigma: float
    growth: float
    windows: int


def measured_noise(depth: NDArray, projection: Pinhole | Orthographic, quantum: float = 0.0) -> float:
    """The standard deviation [m] of a reading on a plane, at the median depth, of a depth image (H, W) [m], NaN where none.

    `quantum` [m] is the step in which the file counts depth. With too few readings to measure: 0.2 % of the depth.
    """
    return noise_of(depth, projection, quantum).sigma


def noise_of(depth: NDArray, projection: Pinhole | Orthographic, quantum: float = 0.0) -> Noise:
    """The noise of a depth image with how it grows with depth; arguments as in `measured_noise`."""
    depth = np.ascontiguousarray(depth, dtype=float)
    pinhole = isinstance(projection, Pinhole)
    windows = [_windows(depth, side, pinhole) for side in SIDES_PX]
    usable = next((found for found in reversed(windows) if len(found) >= MIN_WINDOWS), windows[0])
    middle = _median_depth(depth)
    if len(usable) < MIN_WINDOWS:
        return Noise(float(np.clip(UNKNOWN_SHARE * abs(middle), 0.0005, 0.005)), 0.0, len(usable))
    growth = _growth(usable) if pinhole else 0.0
    sigma = _quantile(usable, middle, growth, BETTER_SHARE)
    if usable is windows[-1]:
        local = _quantile(windows[0], middle, growth, BETTER_SHARE)
        shared = _shared(windows, middle, growth)
        sigma = min(sigma, shared * local) * min(shared, MAX_SHARED)
    return Noise(float(np.clip(sigma, max(LEAST_M, quantum / np.sqrt(12.0)), MOST_M)), growth, len(usable))


def _median_depth(depth: NDArray) -> float:
    """Of every few readings [m]; 1 m if there are none."""
    step = max(1, int(np.sqrt(depth.size / 20_000)))
    some = depth[::step, ::step]
    some = some[np.isfinite(some)]
    some = some if len(some) else depth[np.isfinite(depth)]
    return float(np.median(some)) if len(some) else 1.0


def _quantile(windows: NDArray, middle: float, growth: float, share: float) -> float:
    """The residual [m] at the depth `middle` that this share of the windows stays below."""
    scaled = windows[:, 1] * (middle / windows[:, 0]) ** growth if growth else windows[:, 1]
    return float(np.quantile(scaled, share))


def _shared(windows: list[NDArray], middle: float, growth: float) -> float:
    """How many times the best small windows' residuals are the best large windows', at least 1.

    It is 1 for noise that neighbours do not share. Small parts spoil large windows too, but the middle ones less: a growth that
    sets in late comes from edges.
    """
    small, medium, large = (max(_quantile(found, middle, growth, BEST_SHARE), 1e-9) for found in windows)
    return max(1.0, min(large / small, (medium / small) ** 2))


def _growth(windows: NDArray) -> float:
    """2 if the far windows are noisier than the near ones rather by the square of their depths than not at all, else 0."""
    order = windows[np.argsort(windows[:, 0], kind="stable")]
    near, far = order[: len(order) // 2], order[len(order) // 2 :]
    ratio = float(np.median(far[:, 0]) / np.median(near[:, 0]))
    low, high = (float(np.quantile(half[:, 1], BETTER_SHARE)) for half in (near, far))
    if ratio < GROWTH_RATIO or low < LEAST_M / 10:
        return 0.0
    return 2.0 if np.log(high / low) > np.log(ratio) else 0.0


def _windows(depth: NDArray, side: int, pinhole: bool) -> NDArray:
    """Mean depth and residual [m] (n, 2) of up to `WINDOWS` windows in even steps over the image."""
    found = fit_windows(depth, *window_corners(depth.shape, side, WINDOWS), side, pinhole, MIN_FILLED)
    return found[found[:, 1] >= 0.0, :2]
