"""One pair of edges with its parameters α, d, a₁ and a₂ where they stand in space: Figure 3 of Handey 1987, to be drawn."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array
from handey_studio.geometry.lines import PARALLEL_SIN, nearest_end, relative_pose
from handey_studio.localization.pairs import MIN_ALPHA


@dataclass(frozen=True, eq=False)
class EdgePair(Value):
    """Two edges `ends` (2, 2, 3) [m] in any one frame, and how they stand to one another (Handey 1987 §3, Figure 3).

    `alpha` [rad] is the angle between the unit `directions` (2, 3), each of which looks from the base of the common perpendicular
    along its edge. `feet` (2, 3) [m] are the perpendicular's bases and `d` [m] its length, with a sign that tells the pair
    from its mirror image. `nearest` (2, 3) [m] are the ends nearest to the bases, `a` (2,) [m] the distances to them: a₁ and a₂.

    Of edges that are nearly parallel the base would be anywhere: the perpendicular at the first edge's middle is taken, `d` has no
    sign, and a₁ and a₂ mean nothing (NaN; `nearest` are the bases).
    """

    ends: NDArray
    directions: NDArray
    feet: NDArray
    nearest: NDArray
    alpha: float
    d: float
    a: NDArray

    def __post_init__(self) -> None:
        for key in ("ends", "directions", "feet", "nearest", "a"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))

    @property
    def parallel(self) -> bool:
        """Whether the edges are taken for parallel."""
        return bool(np.isnan(self.a).any())

    def arc(self, radius: float, points: int = 25) -> NDArray:
        """Points (n, 3) from the first edge's direction to the second's, `radius` [m] about the first base."""
        first, second = self.directions
        across = second - first * (first @ second)
        across = across / max(float(np.linalg.norm(across)), PARALLEL_SIN)
        angles = np.linspace(0.0, self.alpha, points)[:, None]
        return self.feet[0] + radius * (np.cos(angles) * first + np.sin(angles) * across)

    def anchors(self, radius: float) -> dict[str, NDArray]:
        """Where the names of the four parameters stand (3,): each by its own stroke, `radius` [m] apart where strokes are short."""
        bisector = self.directions.sum(axis=0)
        bisector = bisector / max(float(np.linalg.norm(bisector)), PARALLEL_SIN)
        base = self.feet.mean(axis=0)
        if self.parallel:
            return {"α": self.feet[0] + 2.2 * radius * self.directions[0], "d": base}
        at = {"α": self.feet[0] + 2.6 * radius * bisector, "d": base if abs(self.d) > 1.5 * radius else base - 0.7 * radius * bisector}
        for k, name in enumerate(("a1", "a2")):
            middle = (self.feet[k] + self.nearest[k]) / 2.0
            at[name] = middle if self.a[k] > 2.0 * radius else self.feet[k] + 2.2 * radius * self.directions[k]
        return at


def edge_pair(ends: NDArray, towards: NDArray | None = None) -> EdgePair:
    """The pair of the edges `ends` (2, 2, 3) [m].

    Of a data edge only the line is known, not the vector. `towards` (2, 3) are the directions of the model edges that it is compared
    with; without them each edge looks away from the base of the common perpendicular.
    """
    middle = ends.mean(axis=1)
    half = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / 2.0
    direction = (ends[:, 1] - ends[:, 0]) / (2.0 * half[:, None])
    if towards is None and direction[0] @ direction[1] < -np.cos(MIN_ALPHA):
        direction[1] *= -1.0
    pose = relative_pose(middle[0], direction[0], middle[1], direction[1])
    if np.sin(pose.alpha) < np.sin(MIN_ALPHA):
        return _parallel(ends, middle, direction, towards)
    foot = np.array([pose.foot1, pose.foot2])
    turn = foot > 0.0 if towards is None else np.einsum("ki,ki->k", direction, towards) < 0.0
    sign = np.where(turn, -1.0, 1.0)
    turned = float(np.prod(sign))
    nearest = middle + np.where(foot > 0.0, half, -half)[:, None] * direction
    return EdgePair(
        ends,
        direction * sign[:, None],
        middle + foot[:, None] * direction,
        nearest,
        float(pose.alpha if turned > 0 else np.pi - pose.alpha),
        turned * float(pose.d),
        nearest_end(foot, -half, half),
    )


def _parallel(ends: NDArray, middle: NDArray, direction: NDArray, towards: NDArray | None) -> EdgePair:
    """The pair of edges so nearly parallel that both take their mean direction for the perpendicular."""
    if towards is not None:
        direction = direction * np.where(np.einsum("ki,ki->k", direction, towards) < 0.0, -1.0, 1.0)[:, None]
    along = direction[0] + np.sign(direction[0] @ direction[1]) * direction[1]
    along /= np.linalg.norm(along)
    between = middle[1] - middle[0]
    feet = np.stack([middle[0], middle[1] - (between @ along) * along])
    alpha = float(np.arctan2(np.linalg.norm(np.cross(direction[0], direction[1])), direction[0] @ direction[1]))
    return EdgePair(ends, direction, feet, feet, alpha, float(np.linalg.norm(feet[1] - feet[0])), np.full(2, np.nan))
