"""A stripe's places along itself: how rough they are, and the same places without what the surface's grain adds to them.

On a plane a stripe is straight but for the speckle of laser light, the photograph's compression and the sensor's noise. So a place may
be taken from a line through the places before and after it, as many as still lie on that line: few beside a corner, many on a plane.
How many is told by the places themselves: the stretch grows as long as what it says agrees with what the shorter ones said.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

REACH = 15  # rows on either side by whose line a place's roughness is told: grain that neighbours share shows too
LEAST_SHARE = 0.6  # of a stretch's rows that must show the stripe
AGREE = 1.2  # deviations by which a longer stretch may differ from all shorter ones; more rounds corners, less keeps the grain


def roughness(places: NDArray) -> float:
    """The standard deviation [px] of a stripe's places (rows,), NaN where there is none, about lines of 2 · REACH + 1 rows.

    It is a median, so corners and steps do not count; nor does an even curve, which lies as far off its line in one place as in the next.
    NaN where no stretch is long enough.
    """
    off = _off_lines(np.array(places, dtype=float), REACH)
    steps = off[REACH:] - off[:-REACH]
    steps = steps[np.isfinite(steps)]
    return 1.4826 * float(np.median(np.abs(steps))) / np.sqrt(2.0) if len(steps) else float("nan")


def along(places: NDArray, deviation: float, reach: int) -> NDArray:
    """A stripe's places (rows,) [px], each from the line through up to `reach` rows on either side; NaN stays NaN.

    `deviation` [px] is a place's own. Where the stripe has a corner or steps, its places stay as they are.
    """
    if not deviation > 0 or reach < 1:
        return places
    reaches = np.unique(np.round(np.geomspace(1, reach, 2 + int(np.log2(reach)))).astype(np.int64))
    return _along(np.array(places, dtype=float), deviation, reaches)


@njit(cache=True)
def _line(places: NDArray, row: int, reach: int) -> tuple[float, float, int]:
    """The line of the places about a row: its value there, that value's deviation if each place's is 1, and how many there were."""
    count, x1, x2, y1, xy = 0, 0.0, 0.0, 0.0, 0.0
    for other in range(max(0, row - reach), min(len(places), row + reach + 1)):
        if np.isfinite(places[other]):
            x, y = float(other - row), places[other] - places[row]
            count += 1
            x1 += x
            x2 += x * x
            y1 += y
            xy += x * y
    spread = count * x2 - x1 * x1
    if spread <= 0.0:
        return places[row], 1.0, count
    return places[row] + (x2 * y1 - x1 * xy) / spread, np.sqrt(x2 / spread), count


@njit(cache=True)
def _off_lines(places: NDArray, reach: int) -> NDArray:
    off = np.full(len(places), np.nan)
    for row in range(len(places)):
        if np.isfinite(places[row]):
            value, _, count = _line(places, row, reach)
            if count >= LEAST_SHARE * (2 * reach + 1):
                off[row] = places[row] - value
    return off


@njit(cache=True)
def _along(places: NDArray, deviation: float, reaches: NDArray) -> NDArray:
    found = places.copy()
    for row in range(len(places)):
        if not np.isfinite(places[row]):
            continue
        low, high = places[row] - AGREE * deviation, places[row] + AGREE * deviation
        for reach in reaches:
            value, share, count = _line(places, row, reach)
            room = AGREE * deviation * share
            if count < LEAST_SHARE * (2 * reach + 1) or value - room > high or value + room < low:
                break
            found[row] = value
            low, high = max(low, value - room), min(high, value + room)
    return found
