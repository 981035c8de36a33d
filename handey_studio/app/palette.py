"""Colours with fixed meanings, chosen to be told apart without red and green: blue, orange, grey."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

RGB = tuple[int, int, int]

BLUE: RGB = (0, 96, 168)  # what the user sets: the destination
SKY: RGB = (86, 180, 233)  # hypotheses
PALE_SKY: RGB = (150, 200, 226)  # those that are not looked at
UNSCANNED: RGB = (176, 182, 190)  # what stands in the cell and was not scanned yet
LIGHT: RGB = (150, 186, 222)  # the edges of the laser's light
ORANGE: RGB = (236, 142, 32)  # what was located: parts
VERMILLION: RGB = (204, 76, 24)  # what collided or fell
TEAL: RGB = (0, 133, 124)  # the grasp
INK: RGB = (32, 41, 53)
GREY: RGB = (128, 138, 150)
PALE: RGB = (214, 219, 226)
ARM_LIGHT: RGB = (222, 227, 233)
ARM_DARK: RGB = (92, 107, 124)
HAND: RGB = (58, 68, 80)
FINGER: RGB = (36, 44, 54)
FILLED: RGB = (154, 165, 177)
TABLE: RGB = (226, 224, 219)
FLOOR: RGB = (226, 230, 235)
BLOCK: RGB = (168, 176, 186)

JUMP: RGB = (196, 40, 140)  # data edges by kind
CONVEX: RGB = INK
CONCAVE: RGB = (150, 92, 16)
FOUND, MISSING, HIDDEN = TEAL, VERMILLION, (150, 158, 168)  # predicted edges

EDGE: RGB = (128, 76, 14)  # edges of a part in a picture
PICKUP, PUTDOWN, OWN = (196, 128, 40), (120, 94, 180), VERMILLION  # what forbids a hand angle: obstacles at either end, the part itself
SHORT: RGB = (150, 158, 168)  # too little contact
BEYOND: RGB = (70, 96, 142)  # out of the arm's reach

STEP_COLOURS: dict[str, RGB] = {
    "free": (122, 134, 148),
    "approach": TEAL,
    "close": INK,
    "lift": (226, 158, 62),
    "transfer": ORANGE,
    "regrasp": (120, 94, 180),
    "place": (190, 104, 16),
    "open": INK,
    "retreat": (122, 134, 148),
}

# Elevation: from the table's blue grey over slate blue to a warm light yellow; lightness rises all the way, so it reads in grey too.
ELEVATION = np.array(
    [
        [198, 208, 219],
        [190, 202, 216],
        [70, 96, 142],
        [58, 120, 164],
        [84, 152, 160],
        [148, 178, 132],
        [210, 196, 100],
        [254, 224, 110],
    ],
    dtype=float,
)
ELEVATION_AT = np.array([0.0, 0.04, 0.10, 0.30, 0.48, 0.66, 0.84, 1.0])

# Residuals: behind the model blue, in front of it red, white where they agree.
RESIDUAL = np.array([[33, 84, 172], [120, 166, 214], [247, 247, 247], [236, 138, 116], [178, 20, 43]], dtype=float)
RESIDUAL_AT = np.linspace(-1.0, 1.0, len(RESIDUAL))

# Clearance: from vermillion where bodies all but touch over pale yellow to blue where there is room.
CLEARANCE = np.array([[204, 76, 24], [236, 142, 32], [250, 226, 150], [120, 166, 214], [33, 84, 172]], dtype=float)
CLEARANCE_AT = np.array([0.0, 0.04, 0.16, 0.5, 1.0])


def css(colour: Sequence[float]) -> str:
    """`#rrggbb`."""
    return "#{:02x}{:02x}{:02x}".format(*(int(c) for c in colour))


def text(colour: Sequence[float]) -> str:
    """The colour of words and signs that tell a meaning by colour: as it is, lighter on the dark page."""
    return f"color-mix(in srgb, {css(colour)}, #fff var(--lift))"


def words_on(colour: Sequence[float]) -> str:
    """White or ink, whichever is the easier to read on a colour."""
    return "#fff" if float(np.dot(colour, (0.2126, 0.7152, 0.0722))) < 120.0 else css(INK)


def elevation_colours(share: NDArray) -> NDArray:
    """Colours (n, 3) uint8 for elevations (n,) as shares of the highest, in [0, 1]."""
    return _between(share, ELEVATION_AT, ELEVATION)


def residual_colours(share: NDArray) -> NDArray:
    """Colours (n, 3) uint8 for residuals (n,) as shares of their limit, in [-1, 1]; beyond it the colour stays."""
    return _between(share, RESIDUAL_AT, RESIDUAL)


def clearance_colours(share: NDArray) -> NDArray:
    """Colours (n, 3) uint8 for clearances (n,) as shares of the greatest that is told, in [0, 1]."""
    return _between(share, CLEARANCE_AT, CLEARANCE)


def _between(share: NDArray, at: NDArray, colours: NDArray) -> NDArray:
    """Colours (n, 3) uint8 between those that stand at given places; beyond the ends the last one."""
    return np.stack([np.interp(share, at, colours[:, k]) for k in range(3)], axis=-1).astype(np.uint8)
