"""Read-only arrays: the values that flow between the rooms never change under anyone's feet."""

from collections.abc import Hashable
from dataclasses import fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray


def frozen_array(values: ArrayLike, dtype: DTypeLike = float) -> NDArray:
    """A contiguous read-only copy of `values`; an array that is already read-only and of that type is shared."""
    if isinstance(values, np.ndarray) and not values.flags.writeable and values.dtype == np.dtype(dtype) and values.flags.c_contiguous:
        return values
    array = np.array(values, dtype=dtype, order="C")
    array.flags.writeable = False
    return array


class Value:
    """Mixin of frozen dataclasses that hold arrays: equal and hashed by content, so that a value can key a cache.

    Use with `@dataclass(frozen=True, eq=False)`.
    """

    @cached_property
    def _content(self: Any) -> tuple:
        return tuple(_hashable(getattr(self, f.name)) for f in fields(self))

    def __eq__(self: Any, other: Any) -> bool:
        return type(other) is type(self) and self._content == other._content

    def __hash__(self: Any) -> int:
        return hash(self._content)

    def __getstate__(self: Any) -> dict[str, Any]:
        return {f.name: getattr(self, f.name) for f in fields(self)}


def _hashable(value: Any) -> Hashable:
    if isinstance(value, np.ndarray):
        return value.shape, value.dtype.str, value.tobytes()
    if isinstance(value, dict):
        return tuple((key, _hashable(item)) for key, item in value.items())
    if isinstance(value, tuple | list):
        return tuple(_hashable(item) for item in value)
    return value
