"""The grid that points fall on: a sensor's own raster where they have one, else cells that their density fills."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

MAX_SIDE = 4096
PATCHES, PATCH_POINTS = 7, 3000  # where the spacing is measured
SCATTERED = 2.2  # points to a cell where they are on no raster: about a tenth of the cells stay empty, mostly alone
REGULAR = 0.8  # how alike the points' phases are on a raster: 1 on an exact one, 0 on none
SEARCH, STEPS = 0.02, 1601  # the spacing is refined within this share, in so many steps
OUTLIERS = 0.0005  # of the points on either side do not widen the grid
MARGIN = 0.05  # of the grid's width, where points that are no outliers may still lie


class Raster(NamedTuple):
    """Pixel (u, v) has its centre at `origin` + (u, v) · `pitch`; `shape` is (H, W). `regular`: the points lie on the centres."""

    origin: tuple[float, float]
    pitch: tuple[float, float]
    shape: tuple[int, int]
    regular: bool

    @classmethod
    def over(
        cls, places: NDArray, pitch: float | tuple[float, float], phase: tuple[float, float] = (0.0, 0.0), regular: bool = False
    ) -> "Raster":
        """The raster that covers places (n, 2), coarser where it would have more than 4096 pixels a side."""
        pitches = np.broadcast_to(np.asarray(pitch, dtype=float), 2)
        low, high = np.quantile(places, [OUTLIERS, 1.0 - OUTLIERS], axis=0)
        low, high = low - MARGIN * (high - low), high + MARGIN * (high - low)
        low, high = np.maximum(low, places.min(axis=0)), np.minimum(high, places.max(axis=0))
        needed = (high - low) / (MAX_SIDE - 2)
        if (pitches < needed).any():
            pitches, regular = np.full(2, float(max(*pitches, *needed))), False
        first = np.rint((low - phase) / pitches)
        last = np.rint((high - phase) / pitches)
        origin, size = np.asarray(phase) + first * pitches, (last - first).astype(int) + 1
        return cls((float(origin[0]), float(origin[1])), (float(pitches[0]), float(pitches[1])), (int(size[1]), int(size[0])), regular)

    def pixels(self, places: NDArray) -> NDArray:
        """(u, v) (n, 2) [px] of places (n, 2)."""
        return (places - self.origin) / self.pitch


def raster_of(places: NDArray) -> Raster:
    """The raster of places (n, 2)."""
    steps, density = _neighbours(places)
    pitches, phases, regular = [], [], len(steps) > 0
    for axis in (0, 1):
        along = np.abs(steps[np.abs(steps[:, 1 - axis]) < 0.3 * np.abs(steps[:, axis]), axis]) if regular else np.empty(0)
        regular = regular and len(along) > 30
        if regular:
            pitch, phase, alike = _refined(places[:, axis], float(np.median(along)))
            pitches.append(pitch)
            phases.append(phase)
            regular = alike > REGULAR
    if regular and 0.5 < pitches[0] / pitches[1] < 2.0:
        return Raster.over(places, (pitches[0], pitches[1]), (phases[0], phases[1]), True)
    return Raster.over(places, float(np.sqrt(SCATTERED / density)))


def _neighbours(places: NDArray) -> tuple[NDArray, float]:
    """Steps (n, 2) from points to their nearest neighbours in a few patches, and the points' median number per unit of area."""
    low, high = np.quantile(places[:: max(1, len(places) // 20_000)], [0.02, 0.98], axis=0)
    reach = 0.5 * np.sqrt(PATCH_POINTS / len(places)) * np.maximum(high - low, 1e-9)
    steps, densities = [], []
    for centre in places[np.linspace(0, len(places) - 1, PATCHES + 2).astype(int)[1:-1]]:
        patch = places[(np.abs(places - centre) <= reach).all(axis=1)][: 3 * PATCH_POINTS]
        if len(patch) < 10:
            continue
        distance, which = (np.asarray(found) for found in KDTree(patch).query(patch, k=9))
        for k in range(1, 5):
            close = (distance[:, k] > 0) & (distance[:, k] < 1.3 * np.maximum(distance[:, 1], 1e-15))
            steps.append(patch[which[close, k]] - patch[close])
        apart = distance[:, 8][distance[:, 8] > 0]
        if len(apart):
            densities.append(8.0 / (np.pi * float(np.median(apart)) ** 2))
    area = float(np.prod(np.maximum(high - low, 1e-9)))
    return np.concatenate(steps) if steps else np.empty((0, 2)), float(np.median(densities)) if densities else max(1.0, len(places)) / area


def _refined(values: NDArray, pitch: float) -> tuple[float, float, float]:
    """The spacing near `pitch` on whose multiples values (n,) lie best, their offset from these, and how well they do, 0 to 1."""
    some = values[np.linspace(0, len(values) - 1, min(len(values), 1500)).astype(int)]
    middle = float(np.median(some))
    trial = pitch * (1.0 + np.linspace(-SEARCH, SEARCH, STEPS))
    waves = np.abs(np.exp(2j * np.pi * (some[:, None] - middle) / trial).mean(axis=0))
    pitch = float(trial[int(np.argmax(waves))])
    phase = middle + pitch * float(np.angle(np.exp(2j * np.pi * (some - middle) / pitch).mean())) / (2 * np.pi)
    number = np.rint((some - phase) / pitch)
    if np.ptp(number) > 0:
        pitch, phase = (float(value) for value in np.polyfit(number, some, 1))
    return pitch, phase, float(waves.max())
