"""The laser's own light in a photograph: its colour, told from what the dark frame shows, or from what is more than grey."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.sensing.stripes.photographs import Photograph

CHANNELS = ("auto", "red", "green", "blue", "grey")
EXCESS = {"blue": (1.0, -0.5, -0.5), "green": (-0.5, 1.0, -0.5), "red": (-0.5, -0.5, 1.0)}
SINGLE = {"blue": (1.0, 0.0, 0.0), "green": (0.0, 1.0, 0.0), "red": (0.0, 0.0, 1.0)}
GREY = (1 / 3, 1 / 3, 1 / 3)
STRIPE_SHARE = 0.0005  # of a photograph's pixels: fewer than a stripe one pixel wide has, so the brightest are all the laser's
COLOURED = 12.0  # least excess of a colour over grey, of 255, that tells a coloured laser
BROAD_PX = 25  # what holds a square of so many pixels is a coloured thing, not a stripe
READABLE = (20.0, 235.0)  # light, of 255, by which the exposures of photograph and dark frame are compared


@dataclass(frozen=True)
class LaserColour:
    """Weights of blue, green and red whose sum over a photograph is the laser's light; `name` is for people."""

    weights: tuple[float, float, float]
    name: str


def laser_light(photograph: Photograph, dark: Photograph | None, colour: LaserColour) -> NDArray:
    """The laser's light (H, W) float32: what the photograph has more than its dark frame, in the laser's colour."""
    light = photograph.light
    if dark is not None:
        light = light - _exposure(photograph, dark) * dark.light
    return light @ np.array(colour.weights, dtype=np.float32)


def laser_colour(pairs: Sequence[tuple[Photograph, Photograph | None]], channel: str) -> LaserColour:
    """The laser's colour by a channel's name, or measured from photographs and their dark frames (`auto`)."""
    if channel not in CHANNELS:
        raise BadInput(f'channel "{channel}" is not known; choose one of: {", ".join(CHANNELS)}.')
    with_dark = all(dark is not None for _, dark in pairs)
    if channel == "grey":
        return LaserColour(GREY, "grey")
    if channel != "auto":
        return LaserColour(SINGLE[channel] if with_dark else EXCESS[channel], channel)
    return _colour_of_differences(pairs) if with_dark else _colour_of_excess(pairs)


def other_lights(colour: LaserColour, with_dark: bool) -> list[LaserColour]:
    """Lights of the same laser that may show a finer line than its own colour: single channels, and without a dark frame the laser's
    channel alone or less one other."""
    if with_dark:
        return [LaserColour(weights, colour.name) for weights in SINGLE.values()]
    own = SINGLE.get(colour.name)
    if own is None:
        return []
    others = [other for name, other in SINGLE.items() if name != colour.name]
    less = [(own[0] - other[0], own[1] - other[1], own[2] - other[2]) for other in others]
    return [LaserColour(weights, colour.name) for weights in (own, *less)]


def _colour_of_differences(pairs: Sequence[tuple[Photograph, Photograph | None]]) -> LaserColour:
    total = np.zeros(3)
    for photograph, dark in pairs:
        if dark is None:
            continue
        more = photograph.light - _exposure(photograph, dark) * dark.light
        total += _brightest(cv2.GaussianBlur(more, (0, 0), 1.0)).mean(axis=0)
    weights = np.clip(total, 0.0, None)
    if weights.sum() <= 0:
        return LaserColour(GREY, "grey")
    blue, green, red = (weights / weights.sum()).tolist()
    return LaserColour((blue, green, red), _name(weights))


def _colour_of_excess(pairs: Sequence[tuple[Photograph, Photograph | None]]) -> LaserColour:
    best, strength = LaserColour(GREY, "grey"), COLOURED
    for name, weights in EXCESS.items():
        narrow = []
        for photograph, _ in pairs:
            excess = np.maximum(cv2.GaussianBlur(photograph.light @ np.array(weights, dtype=np.float32), (0, 0), 1.0), 0.0)
            thin = excess - cv2.morphologyEx(excess, cv2.MORPH_OPEN, np.ones((BROAD_PX, BROAD_PX), np.uint8))
            narrow.append(float(np.quantile(thin, 1.0 - STRIPE_SHARE)))
        if np.median(narrow) > strength:
            best, strength = LaserColour(weights, name), float(np.median(narrow))
    return best


def _brightest(light: NDArray) -> NDArray:
    """The strongest pixels (n, 3) of an image (H, W, 3)."""
    flat = light.reshape(-1, 3)
    count = max(1, int(STRIPE_SHARE * len(flat)))
    return flat[np.argpartition(flat.sum(axis=1), -count)[-count:]]


def _name(weights: NDArray) -> str:
    return ("blue", "green", "red")[int(np.argmax(weights))] if weights.max() > 1.2 * weights.mean() else "grey"


def _exposure(photograph: Photograph, dark: Photograph) -> np.float32:
    """How much brighter the photograph is exposed than its dark frame, by what neither laser nor the scale's end touches."""
    if photograph.light.shape != dark.light.shape:
        raise BadInput(f"a photograph is {photograph.size} px and its dark frame {dark.size} px; they must be of one size.")
    a, b = photograph.light[::4, ::4].mean(axis=2), dark.light[::4, ::4].mean(axis=2)
    known = (b > READABLE[0]) & (b < READABLE[1]) & (a < READABLE[1])
    return np.float32(np.median(a[known] / b[known])) if known.sum() >= 100 else np.float32(1.0)
