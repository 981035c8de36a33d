"""Values to plain JSON and back.

Short arrays of floats are written as numbers that a person can read and edit; the others as base64 of their little-endian
bytes. Numbers that JSON lacks are written by name.
"""

import base64
import binascii
import math
from typing import Any, TypeVar

import msgspec
import numpy as np

from handey_studio.base.errors import BadInput

T = TypeVar("T")
DTYPES = ("<f8", "<f4", "<i8", "<i4", "|u1", "|b1")
MAX_ARRAY_NUMBERS = 20_000_000  # a depth map of 4000 × 4000 cells passes
MAX_DIMENSIONS = 5
READABLE_NUMBERS = 96  # a pose or the corners of a simple part; longer arrays go as bytes
ODD_NUMBERS = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


def to_plain(value: Any) -> Any:
    """A value as dicts, lists and numbers that JSON can hold."""
    return _named_odd_numbers(msgspec.to_builtins(value, enc_hook=_plain))


def from_plain(plain: Any, kind: type[T]) -> T:
    """The value of a kind (a dataclass) from what `to_plain` made. Raises BadInput with one sentence."""
    try:
        return msgspec.convert(_with_arrays(plain), kind, dec_hook=_as_array)
    except (msgspec.ValidationError, AttributeError) as error:  # an array where a mapping belongs has no keys
        raise BadInput(f"{str(error).rstrip('.')}.") from None


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return plain_array(value)
    if isinstance(value, np.generic):
        return value.item()
    raise NotImplementedError(f"a {type(value).__name__} has no place in a file")


def plain_array(array: np.ndarray) -> dict[str, Any]:
    """A short array of finite floats as its numbers, any other as its type, shape and bytes."""
    if array.dtype == np.float64 and array.ndim and 0 < array.size <= READABLE_NUMBERS and np.isfinite(array).all():
        return {"array": array.tolist()}
    little = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
    if little.dtype.str not in DTYPES:
        raise BadInput(f'an array of type "{little.dtype.str}" cannot be kept in a file; it must be one of {", ".join(DTYPES)}.')
    return {"dtype": little.dtype.str, "shape": list(array.shape), "base64": base64.b64encode(little.tobytes()).decode("ascii")}


def read_array(plain: dict[str, Any]) -> np.ndarray:
    """The array whose bytes `plain_array` wrote, checked before anything is allocated."""
    dtype, shape, text = plain["dtype"], plain["shape"], plain["base64"]
    if dtype not in DTYPES:
        raise BadInput(f'an array has the type "{str(dtype)[:20]}"; it must be one of {", ".join(DTYPES)}.')
    if not isinstance(shape, list) or len(shape) > MAX_DIMENSIONS or not all(type(n) is int and 0 <= n <= MAX_ARRAY_NUMBERS for n in shape):
        raise BadInput(f"an array has the shape {str(shape)[:60]}; it must be up to {MAX_DIMENSIONS} whole numbers.")
    count = math.prod(shape)
    if count > MAX_ARRAY_NUMBERS:
        raise BadInput(f"an array of shape {shape} holds {count} numbers, the limit is {MAX_ARRAY_NUMBERS}.")
    try:
        data = base64.b64decode(text, validate=True)
    except (binascii.Error, TypeError, ValueError):
        raise BadInput(f"the bytes of an array of shape {shape} are not base64.") from None
    if len(data) != count * np.dtype(dtype).itemsize:
        raise BadInput(f"an array of shape {shape} needs {count * np.dtype(dtype).itemsize} bytes, the file has {len(data)}.")
    array = np.frombuffer(data, dtype).reshape(shape)
    array.flags.writeable = False
    return array


def _with_arrays(plain: Any) -> Any:
    """Everything below `plain` with its arrays and odd numbers put back."""
    if isinstance(plain, list):
        return [_with_arrays(item) for item in plain]
    if not isinstance(plain, dict):
        return plain
    if plain.keys() == {"dtype", "shape", "base64"}:
        return read_array(plain)
    if plain.keys() == {"array"}:
        return _as_array(np.ndarray, plain["array"])
    if plain.keys() == {"number"}:
        return _odd_number(plain["number"])
    return {key: _with_arrays(item) for key, item in plain.items()}


def _odd_number(name: Any) -> float:
    if name not in ODD_NUMBERS:
        raise BadInput(f'"{str(name)[:20]}" is not a number; one of {", ".join(ODD_NUMBERS)} was expected.')
    return ODD_NUMBERS[name]


def _named_odd_numbers(plain: Any) -> Any:
    if isinstance(plain, float) and not math.isfinite(plain):
        return {"number": "nan" if math.isnan(plain) else "inf" if plain > 0 else "-inf"}
    if isinstance(plain, list | tuple):
        return [_named_odd_numbers(item) for item in plain]
    if isinstance(plain, dict):
        return {key: _named_odd_numbers(item) for key, item in plain.items()}
    return plain


def _as_array(kind: Any, value: Any) -> np.ndarray:
    """Where a dataclass wants an array: one that was written as such, or a plain list of numbers typed by hand."""
    if isinstance(value, np.ndarray):
        return value
    if not isinstance(value, list):
        raise BadInput(f"an array was expected, not {type(value).__name__}.")
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise BadInput("a list of numbers, all rows of one length, was expected as an array.") from None
    array.flags.writeable = False
    return array
