"""What a step of a model's history points at: by geometry, not by number, so that edits before it keep its meaning.

A reference is where a person clicked, in the model's frame [m]; it is looked up in the solid as it stands when the step is replayed.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handey_studio.base import BadInput, Value, frozen_array

MAX_COORDINATE_M = 10.0  # parts are up to 3 m across; anything farther off is a slip of the hand or a broken file


@dataclass(frozen=True, eq=False)
class FaceAt(Value):
    """A face by a `point` (3,) [m] on or near it and its outward unit `normal` (3,)."""

    point: NDArray
    normal: NDArray

    def __post_init__(self) -> None:
        keep(self, "point", numbers(self.point, (3,), "the point of a face"))
        keep(self, "normal", unit(self.normal, "the normal of a face"))


@dataclass(frozen=True, eq=False)
class EdgeAt(Value):
    """An edge, or a line, by a `point` (3,) [m] on or near it and its unit `direction` (3,).

    Where an end matters, as for a typed length, it is the end that the direction leads to that moves.
    """

    point: NDArray
    direction: NDArray

    def __post_init__(self) -> None:
        keep(self, "point", numbers(self.point, (3,), "the point of an edge"))
        keep(self, "direction", unit(self.direction, "the direction of an edge"))


@dataclass(frozen=True, eq=False)
class CornerAt(Value):
    """A corner, or any point, by its place `point` (3,) [m]."""

    point: NDArray

    def __post_init__(self) -> None:
        keep(self, "point", numbers(self.point, (3,), "a corner"))


Reference = FaceAt | EdgeAt | CornerAt


def keep(value: Any, name: str, content: Any) -> None:
    """Set a field of a frozen dataclass while it is being made."""
    object.__setattr__(value, name, content)


def numbers(values: ArrayLike, shape: tuple[int, ...], what: str, limit: float = MAX_COORDINATE_M) -> NDArray:
    """A read-only array of that shape (−1: any length) of finite numbers within ± `limit`. Raises BadInput."""
    try:
        array = frozen_array(values)
    except (TypeError, ValueError):
        raise BadInput(f"{what} must be numbers.") from None
    if array.ndim != len(shape) or any(want not in (-1, have) for want, have in zip(shape, array.shape, strict=True)):
        raise BadInput(f"{what} has the shape {array.shape}; it must be {str(shape).replace('-1', 'n')}.")
    if not np.isfinite(array).all() or np.abs(array).max(initial=0.0) > limit:
        raise BadInput(f"{what} must be finite numbers within ±{limit:g}.")
    return array


def number(value: float, what: str, low: float = -MAX_COORDINATE_M, high: float = MAX_COORDINATE_M) -> float:
    """A finite number from `low` to `high`. Raises BadInput."""
    if not low <= value <= high:
        raise BadInput(f"{what} is {value:g}; it must be a number from {low:g} to {high:g}.")
    return float(value)


def unit(vector: ArrayLike, what: str) -> NDArray:
    """The unit vector (3,) along a vector. Raises BadInput when it has no direction."""
    array = numbers(vector, (3,), what)
    length = float(np.linalg.norm(array))
    if length < 1e-9:
        raise BadInput(f"{what} has no direction; it must be a vector longer than zero.")
    return array if abs(length - 1.0) < 1e-15 else frozen_array(array / length)
