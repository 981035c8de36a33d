"""An outline on a plane: the corners as clicked, and where the constraints on its sides put them (Handey 1987 §1).

The constraints c(x) = 0 of the corners x are met by Newton steps of least length from the clicks x₀: x ← x₀ − J⁺ (c + J (x₀ − x)). Where
they are linear, as horizontal, vertical and snapped ones are, one step is exact. Constraints that say the same twice do no harm.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from handey_studio.base import BadInput, Value, frozen_array, measured
from handey_studio.modeling.constraints import Constraint, check_constraint, equation, equations
from handey_studio.modeling.references import keep, numbers

MAX_CORNERS = 200
MAX_CONSTRAINTS = 600
MOST_STEPS = 40
LEAST_SIDE_M = 5e-4  # two clicks closer than half a millimetre are one click
LEAST_AREA_M2 = 1e-6
MET_M = 1e-10  # a constraint that is met to this is exact to all that a file keeps
CONTRADICTED_M = 1e-6
RANK = 1e-7  # singular values below this share of the greatest mean that constraints depend on one another


@dataclass(frozen=True, eq=False)
class Outline(Value):
    """A closed outline: `clicks` (n, 2) [m] in its plane's x and y, in order either way round, and the `constraints` on its sides.

    `corners` are where the constraints put them. Raises BadInput for numbers that cannot be; whether the outline encloses anything is
    told by `sound_corners`.
    """

    clicks: NDArray
    constraints: tuple[Constraint, ...] = ()

    def __post_init__(self) -> None:
        keep(self, "clicks", numbers(self.clicks, (-1, 2), "the corners of an outline"))
        if not 3 <= len(self.clicks) <= MAX_CORNERS:
            raise BadInput(f"an outline has {len(self.clicks)} corners; it must have 3 to {MAX_CORNERS}.")
        if len(self.constraints) > MAX_CONSTRAINTS:
            raise BadInput(f"an outline has {len(self.constraints)} constraints, the limit is {MAX_CONSTRAINTS}.")
        for constraint in self.constraints:
            check_constraint(constraint, len(self.clicks))

    @cached_property
    def corners(self) -> NDArray:
        """Corners (n, 2) [m] as near to the clicks as the constraints that are on allow. Raises BadInput when they contradict."""
        return solved_corners(self.clicks, self.constraints)


def sound_corners(outline: Outline) -> NDArray:
    """The outline's corners (n, 2) [m], counter-clockwise. Raises BadInput when two coincide, sides cross, or nothing is enclosed."""
    corners = outline.corners
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    if sides.min() < LEAST_SIDE_M:
        i = int(np.argmin(sides))
        raise BadInput(
            f"corners {i + 1} and {(i + 1) % len(corners) + 1} of the outline are {measured(float(sides[i]), 'm')} apart; "
            f"a side must be at least {measured(LEAST_SIDE_M, 'm')} long."
        )
    polygon = shapely.Polygon(corners)
    if not polygon.is_valid:
        raise BadInput(f"the outline touches or crosses itself{_crossing(polygon)}; its sides must meet at its corners only.")
    if polygon.area < LEAST_AREA_M2:
        raise BadInput(f"the outline encloses {measured(polygon.area, 'm²')}; it must enclose at least {measured(LEAST_AREA_M2, 'm²')}.")
    return corners if polygon.exterior.is_ccw else frozen_array(corners[::-1])


def _crossing(polygon: shapely.Polygon) -> str:
    """Which two sides cross, in words."""
    corners = shapely.get_coordinates(polygon)
    sides = [shapely.LineString(pair) for pair in pairwise(corners)]
    n = len(sides)
    for i in range(n):
        for j in range(i + 2, n - (i == 0)):
            if shapely.intersects(sides[i], sides[j]):
                return f": side {i + 1} meets side {j + 1}"
    return ""


def solved_corners(clicks: NDArray, constraints: tuple[Constraint, ...]) -> NDArray:
    """Corners (n, 2) [m] nearest to the clicks that meet the constraints that are on. Raises BadInput when these contradict."""
    corners, errors, asked = solve(clicks, constraints)
    if len(errors) and errors.max() > CONTRADICTED_M:
        worst = asked[int(np.argmax(errors))]
        raise BadInput(
            f'the constraints of the outline contradict one another: "{worst.told}" at {worst.place} is off by '
            f"{measured(float(errors.max()), 'm')}; switch one of them off."
        )
    return corners


def solve(clicks: NDArray, constraints: tuple[Constraint, ...]) -> tuple[NDArray, NDArray, list[Constraint]]:
    """Corners (n, 2) [m]; how far each constraint that is on is from being met [m]; and these constraints, in that order."""
    asked = [constraint for constraint in constraints if constraint.on]
    start = np.asarray(clicks, dtype=float)
    corners = start.copy()
    for _ in range(MOST_STEPS if asked else 0):
        values, slopes = equations(corners, asked)
        ahead = values + slopes @ (start - corners).ravel()
        following = start - np.linalg.lstsq(slopes, ahead, rcond=RANK)[0].reshape(-1, 2)
        step = np.abs(following - corners).max()
        corners = following
        if step < MET_M:
            break
    errors = np.array([np.abs(equation(corners, constraint)[0]).max() for constraint in asked])
    return frozen_array(corners), errors, asked
