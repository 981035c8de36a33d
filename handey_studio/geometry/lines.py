"""The relative pose of two edges in space: α, d, a₁ and a₂ (Handey 1987 §3, Figure 3)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array

PARALLEL_SIN = 1e-6  # below this sine of α the common perpendicular has no definite foot


@dataclass(frozen=True, eq=False)
class RelativePose(Value):
    """How pairs of directed lines stand to one another; every field has the shape of the pairs, (...).

    `alpha` [rad] in [0, π] is the angle from the first direction to the second. `d` [m] is the signed length of the
    common perpendicular, from the first line to the second along first × second. `foot1` and `foot2` [m] are where it
    stands: the position along each direction, counted from the point that the line was given by. Of parallel lines the
    perpendicular through the first line's point is taken and `d` is its length, without a sign.
    """

    alpha: NDArray
    d: NDArray
    foot1: NDArray
    foot2: NDArray

    def __post_init__(self) -> None:
        for key in ("alpha", "d", "foot1", "foot2"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))


def relative_pose(points1: NDArray, directions1: NDArray, points2: NDArray, directions2: NDArray) -> RelativePose:
    """Relative poses of lines given by points (..., 3) [m] and unit directions (..., 3), pair by pair.

    Turning one direction round maps α to π − α, and changes the signs of d and of that line's foot: this is the missing
    sign of Handey 1987 §3.
    """
    normal = np.cross(directions1, directions2)
    sine = np.linalg.norm(normal, axis=-1)
    cosine = np.sum(directions1 * directions2, axis=-1)
    between = points2 - points1
    along1, along2 = np.sum(between * directions1, axis=-1), np.sum(between * directions2, axis=-1)
    skew = sine > PARALLEL_SIN
    safe = np.where(skew, sine, 1.0)
    foot1 = np.where(skew, (along1 - cosine * along2) / safe**2, 0.0)
    foot2 = np.where(skew, (cosine * along1 - along2) / safe**2, -along2)
    across = np.linalg.norm(between - along1[..., None] * directions1, axis=-1)
    d = np.where(skew, np.sum(between * normal, axis=-1) / safe, across)
    return RelativePose(np.arctan2(sine, cosine), d, foot1, foot2)


def nearest_end(foot: NDArray, start: NDArray | float, end: NDArray | float) -> NDArray:
    """a₁ or a₂ (...) [m]: distance from the foot of the common perpendicular to the nearest end of its edge.

    `start` and `end` are the edge's ends along its line, counted as the foot is.
    """
    return np.minimum(np.abs(foot - start), np.abs(foot - end))
