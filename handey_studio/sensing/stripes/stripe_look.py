"""How the laser looks in photographs: in which light its stripe is read best, and which way it runs.

Where the laser is overexposed, or the file kept colours coarsely, another light than the strongest may draw the finer line: the stripe
itself tells, by how rough its run is.
"""

from collections.abc import Sequence

import numpy as np

from handey_studio.sensing.stripes.photographs import Photograph
from handey_studio.sensing.stripes.stripe_light import LaserColour, laser_colour, laser_light, other_lights
from handey_studio.sensing.stripes.stripe_peaks import PeakOptions, find_peaks, stripe_direction

SAMPLES = 5  # photographs by which the laser's colour and the stripe's direction are told

Pairs = Sequence[tuple[Photograph, Photograph | None]]


def sampled(count: int) -> list[int]:
    """Which of so many photographs, in order, are looked at first: spread evenly, without the ends, where stripes often miss the scene."""
    return np.unique(np.linspace(0, count - 1, min(count, SAMPLES) + 2).round().astype(int)[1:-1]).tolist()


def how_it_looks(pairs: Pairs, channel: str, direction: str = "auto", options: PeakOptions = PeakOptions()) -> tuple[LaserColour, str]:
    """The laser's light and the stripes' direction in photographs and their dark frames; what is given is kept, `auto` is measured."""
    colour = laser_colour(pairs, channel)
    if direction == "auto":
        direction = stripe_direction([(laser_light(one, dark, colour), one.saturated) for one, dark in pairs], options)
    if channel == "auto":
        lights = [colour, *other_lights(colour, all(dark is not None for _, dark in pairs))]
        colour = min(lights, key=lambda light: _uncertainty(pairs, light, direction, options))
    return colour, direction


def _uncertainty(pairs: Pairs, colour: LaserColour, direction: str, options: PeakOptions) -> float:
    """How well a light tells where a stripe runs [px]: its peaks' roughness over the root of their number."""
    roughness, count = [], 0
    for one, dark in pairs:
        peaks = find_peaks(laser_light(one, dark, colour), one.saturated, direction, options)
        count += len(peaks.uv)
        roughness.append(peaks.roughness)
    known = np.array(roughness)[np.isfinite(roughness)]
    return float(np.median(known)) / np.sqrt(count) if len(known) else np.inf
