"""Where the stripe runs through a photograph: one peak a row (or column), to a fraction of a pixel, or a reason why none.

The light of a row is smoothed a little, and what stays bright over more than a stripe's width is taken away. The strongest
peak's centre of gravity is the stripe, unless another is nearly as strong: then one of the two is a reflection or another
surface, and nobody can say which. What the surface's grain does to a peak is averaged away along the stripe, where it is straight.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.sensing.stripes.stripe_along import along, roughness

DIRECTIONS = ("auto", "down", "across")
REASONS = ("kept", "no stripe", "faint", "two peaks", "too wide", "at the border", "alone")
KEPT, NO_STRIPE, FAINT, TIED, WIDE, BORDER, ALONE = range(len(REASONS))
LEAST_LIGHT = 4.0  # of 255, after smoothing; noise may ask for more
NOISE_FACTOR = 6.0
MOUNTAINS = 6  # so many are looked at in a row before it is given up
FLOOR = 0.1  # of the peak's height: light below it is the stripe's halo
AROUND = 3  # rows on either side in which a peak looks for the rest of its stripe


@dataclass(frozen=True)
class PeakOptions:
    """How peaks are found. `smooth_px` is the Gaussian's sigma along the row; `max_width_px` the stripe's greatest width, half way up.

    A peak below `faint` of the photograph's strong ones is a reflection; one that another reaches to `tie` is one of two. Where the
    stripe is straight a peak is averaged with up to `along_px` rows on either side; 0 leaves each row alone.
    """

    smooth_px: float = 1.0
    max_width_px: int = 24
    faint: float = 0.04
    tie: float = 0.6
    along_px: int = 8


@dataclass(frozen=True, eq=False)
class StripePeaks:
    """Peaks (n, 2) [px] (u, v) of one photograph; their light, of 255, widths (n,) [px] at half height, and which are `saturated` (n,).

    `roughness` [px] is the deviation of single rows' peaks from the stripe's run, NaN for a stripe too short to tell. `dropped`
    counts the rows (columns, for a stripe that runs across) without a peak, by reason.
    """

    uv: NDArray
    light: NDArray
    width: NDArray
    saturated: NDArray
    roughness: float
    dropped: dict[str, int]


def find_peaks(light: NDArray, saturated: NDArray, direction: str, options: PeakOptions = PeakOptions()) -> StripePeaks:
    """The stripe's peaks in the laser's light (H, W). A stripe that runs `down` has one a row, one `across` one a column."""
    if direction not in DIRECTIONS[1:]:
        raise BadInput(f'a stripe runs "{direction}"; choose one of: {", ".join(DIRECTIONS)}.')
    across = direction == "across"
    rows = np.ascontiguousarray(light.T if across else light, dtype=np.float32)
    full = saturated.T if across else saturated
    signal, noise = _signal(rows, full, options)
    limit = max(LEAST_LIGHT, NOISE_FACTOR * noise)
    place, height, width, state = _row_peaks(signal, limit, options.max_width_px, options.tie)
    seen = state != NO_STRIPE
    if seen.any():
        state[seen & (height < options.faint * np.quantile(height[seen], 0.9))] = FAINT
    _drop_alone(place, state, AROUND)
    kept = np.flatnonzero(state == KEPT)
    hot = full[kept, np.round(place[kept]).astype(int)]
    run = np.where(state == KEPT, place, np.nan)
    rough = roughness(run)
    uv = np.stack([along(run, rough, options.along_px)[kept], kept.astype(float)], axis=1)
    dropped = {reason: int((state == number).sum()) for number, reason in enumerate(REASONS) if number != KEPT}
    return StripePeaks(uv[:, ::-1].copy() if across else uv, height[kept], width[kept], hot, rough, dropped)


def stripe_direction(lights: Sequence[tuple[NDArray, NDArray]], options: PeakOptions = PeakOptions()) -> str:
    """Whether the stripes of photographs (light, saturated) run down or across: the way in which they are bright and narrow."""
    sharpness = dict.fromkeys(DIRECTIONS[1:], 0.0)
    for direction in sharpness:
        for light, saturated in lights:
            peaks = find_peaks(light, saturated, direction, options)
            sharpness[direction] += float((peaks.light / peaks.width).sum())
    return max(sharpness, key=sharpness.__getitem__)


def _signal(rows: NDArray, saturated: NDArray, options: PeakOptions) -> tuple[NDArray, float]:
    """Light above what is broader than a stripe, smoothed along the rows, and the standard deviation of its noise."""
    wide = np.ones((1, 2 * options.max_width_px + 1), np.uint8)
    if saturated.any():  # in a white-hot core all colours are full, and the laser's own seems to be missing
        narrow = np.ones((1, options.max_width_px + 1), np.uint8)
        rows = np.where(saturated, np.maximum(rows, cv2.morphologyEx(rows, cv2.MORPH_CLOSE, narrow)), rows)
    smooth = cv2.GaussianBlur(rows, (0, 0), sigmaX=options.smooth_px, sigmaY=1e-6, borderType=cv2.BORDER_REPLICATE)
    steps = np.abs(np.diff(smooth[:, ::3], axis=1))  # three pixels apart: the smoothing's own correlation is gone
    noise = 1.4826 * float(np.median(steps)) / np.sqrt(2.0) if steps.size else 0.0
    return smooth - cv2.morphologyEx(smooth, cv2.MORPH_OPEN, wide), noise


@njit(cache=True)
def _row_peaks(signal: NDArray, limit: float, max_width: int, tie: float) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Per row: the strongest peak's place [px], height, width at half height, and what became of it. What is too wide is passed over."""
    rows = len(signal)
    place, height, width = np.full(rows, np.nan), np.zeros(rows), np.zeros(rows)
    state = np.full(rows, NO_STRIPE)
    for r in range(rows):
        row = signal[r].copy()
        for _ in range(MOUNTAINS):
            top = int(np.argmax(row))
            if row[top] < max(limit, tie * height[r]):
                break
            left, right = _crossing(row, top, -1), _crossing(row, top, 1)
            outside = left <= 0.0 or right >= len(row) - 1.0
            if right - left > max_width or outside:
                if state[r] == NO_STRIPE:
                    state[r] = BORDER if outside else WIDE
            elif state[r] == KEPT:
                state[r] = TIED
                break
            else:
                height[r], width[r], state[r] = row[top], right - left, KEPT
                place[r] = _gravity(row, 0.5 * (left + right), 0.75 * width[r] + 1.0, FLOOR * row[top])
            _level(row, left, right)
    return place, height, width, state


@njit(cache=True)
def _level(row: NDArray, left: float, right: float) -> None:
    """Take the mountain between two half heights out of the row, with its slopes down to the valleys."""
    a, b = max(0, int(np.floor(left))), min(len(row) - 1, int(np.ceil(right)))
    while a > 0 and row[a - 1] <= row[a]:
        a -= 1
    while b < len(row) - 1 and row[b + 1] <= row[b]:
        b += 1
    row[a : b + 1] = 0.0


@njit(cache=True)
def _crossing(row: NDArray, top: int, step: int) -> float:
    """Where the row falls through half the height of `top`, going by `step`; the row's end if it does not."""
    half, i = 0.5 * row[top], top
    while 0 <= i + step < len(row):
        if row[i + step] < half:
            return i + step * (row[i] - half) / (row[i] - row[i + step])
        i += step
    return float(i)


@njit(cache=True)
def _gravity(row: NDArray, centre: float, reach: float, floor: float) -> float:
    """The centre of gravity of the light above `floor` within `reach` of itself."""
    for _ in range(6):
        total, moment = 0.0, 0.0
        for i in range(max(0, int(np.ceil(centre - reach - 0.5))), min(len(row) - 1, int(np.floor(centre + reach + 0.5))) + 1):
            share = min(1.0, max(0.0, reach + 0.5 - abs(i - centre)))  # pixels at the ends count by how much of them is within
            weight = share * max(0.0, row[i] - floor)
            total += weight
            moment += weight * i
        if total <= 0.0:
            return centre
        centre, before = moment / total, centre
        if abs(centre - before) < 1e-4:
            break
    return centre


@njit(cache=True)
def _drop_alone(place: NDArray, state: NDArray, around: int) -> None:
    """Peaks that no other within `around` rows continues, at up to 72° from the rows' normal, are no stripe."""
    alone = np.zeros(len(place), dtype=np.bool_)
    for r in range(len(place)):
        if state[r] != KEPT:
            continue
        company = 0
        for other in range(max(0, r - around), min(len(place), r + around + 1)):
            if other != r and state[other] == KEPT and abs(place[other] - place[r]) <= 3.0 * abs(other - r) + 0.5:
                company += 1
        alone[r] = company < 2
    for r in range(len(place)):
        if alone[r]:
            state[r] = ALONE
