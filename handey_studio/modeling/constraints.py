"""What is asked of the sides of an outline, as equations in its corners."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput, measured
from handey_studio.modeling.references import number

Kind = Literal["horizontal", "vertical", "along", "parallel", "perpendicular", "equal", "length", "at", "on line"]
OF_TWO_SIDES = ("parallel", "perpendicular", "equal")
OF_CORNERS = ("at", "on line")
NUMBERS = {"along": 1, "length": 1, "at": 2, "on line": 3}
SIGNS = {"horizontal": "―", "vertical": "|", "along": "∥", "parallel": "∥", "perpendicular": "⟂", "equal": "="}


@dataclass(frozen=True)
class Constraint:
    """One thing that is asked of an outline; a person sees it beside side (or corner) `item` and can switch it off with `on`.

    "horizontal", "vertical": the side runs along the plane's x or y. "along": it has the direction `values` = (angle [rad],), that of
    something seen. "parallel", "perpendicular", "equal": as side `other`. "length": `values` = (m,). Of a corner: "at", `values` =
    (x, y) [m]; "on line", `values` = (x, y [m], angle [rad]). Side i runs from corner i to the next one.
    """

    kind: Kind
    item: int
    other: int = -1
    values: tuple[float, ...] = ()
    on: bool = True

    @property
    def told(self) -> str:
        """As it is written on screen: "⟂ side 1"; sides and corners are counted from 1."""
        if self.kind in OF_TWO_SIDES:
            return f"{SIGNS[self.kind]} side {self.other + 1}"
        if self.kind == "length":
            return measured(self.values[0], "m")
        if self.kind == "along":
            return f"∥ at {measured(self.values[0], 'rad')}"
        return f"{SIGNS[self.kind]} {self.kind}" if self.kind in SIGNS else {"at": "on a point", "on line": "on a line"}[self.kind]

    @property
    def place(self) -> str:
        """What it is asked of, in words."""
        return f"{'corner' if self.kind in OF_CORNERS else 'side'} {self.item + 1}"


def check_constraint(constraint: Constraint, corners: int) -> None:
    """Raises BadInput when a constraint names a side or corner that is not there, or lacks its numbers."""
    named = (constraint.item, constraint.other) if constraint.kind in OF_TWO_SIDES else (constraint.item,)
    if not all(0 <= item < corners for item in named) or (len(named) == 2 and named[0] == named[1]):
        raise BadInput(f'the constraint "{constraint.kind}" names {named}; it must name different ones of {corners} sides, counted from 0.')
    if len(constraint.values) != NUMBERS.get(constraint.kind, 0):
        raise BadInput(
            f'the constraint "{constraint.kind}" has {len(constraint.values)} numbers; it must have {NUMBERS.get(constraint.kind, 0)}.'
        )
    for value in constraint.values:
        number(value, f'a number of the constraint "{constraint.kind}"')


def equations(corners: NDArray, constraints: list[Constraint]) -> tuple[NDArray, NDArray]:
    """Values (k,) [m] that are zero where the constraints are met, and their slopes (k, 2n) in the corners."""
    rows = [equation(corners, constraint) for constraint in constraints]
    return np.concatenate([values for values, _ in rows]), np.concatenate([slopes for _, slopes in rows])


def rank(corners: NDArray, constraints: list[Constraint]) -> int:
    """How many independent things the constraints ask for at these corners."""
    return int(np.linalg.matrix_rank(equations(corners, constraints)[1], tol=1e-6)) if constraints else 0


def equation(corners: NDArray, constraint: Constraint) -> tuple[NDArray, NDArray]:
    """Values (k,) and slopes (k, 2n) of one constraint: one equation, or two for a corner that is at a point."""
    n = len(corners)
    i, kind = constraint.item, constraint.kind
    if kind == "at":
        slopes = np.zeros((2, n, 2))
        slopes[[0, 1], i, [0, 1]] = 1.0
        return corners[i] - constraint.values, slopes.reshape(2, -1)
    slopes = np.zeros((n, 2))
    if kind == "on line":
        across = _across(constraint.values[2])
        slopes[i] = across
        return np.array([across @ (corners[i] - constraint.values[:2])]), slopes.reshape(1, -1)
    value, slope_i, slope_j = _of_sides(corners, constraint)
    for side, slope in ((i, slope_i), (constraint.other, slope_j)):
        if slope is not None:
            slopes[(side + 1) % n] += slope
            slopes[side] -= slope
    return np.array([value]), slopes.reshape(1, -1)


def _of_sides(corners: NDArray, constraint: Constraint) -> tuple[float, NDArray, NDArray | None]:
    """Value [m] of a constraint on a side and its slopes (2,) in that side's vector and in the other's."""
    side = corners[(constraint.item + 1) % len(corners)] - corners[constraint.item]
    if constraint.kind in ("horizontal", "vertical", "along"):
        angle = {"horizontal": 0.0, "vertical": np.pi / 2}.get(constraint.kind) if not constraint.values else constraint.values[0]
        across = _across(float(angle or 0.0))
        return float(across @ side), across, None
    length = max(float(np.linalg.norm(side)), 1e-9)
    if constraint.kind == "length":
        return length - constraint.values[0], side / length, None
    other = corners[(constraint.other + 1) % len(corners)] - corners[constraint.other]
    other_length = max(float(np.linalg.norm(other)), 1e-9)
    if constraint.kind == "equal":
        return length - other_length, side / length, -other / other_length
    turned = _quarter(other) if constraint.kind == "parallel" else other
    unit, unit_side = turned / other_length, side / length
    back = -_quarter(unit_side) if constraint.kind == "parallel" else unit_side
    return float(unit @ side), unit, (back * length - float(unit @ side) * other / other_length) / other_length


def _across(angle: float) -> NDArray:
    return np.array([-np.sin(angle), np.cos(angle)])


def _quarter(vector: NDArray) -> NDArray:
    """A vector (2,) turned by a quarter to the left."""
    return np.array([-vector[1], vector[0]])
