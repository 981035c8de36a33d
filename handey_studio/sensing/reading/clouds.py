"""Point clouds from files: `.npy` arrays, PLY and PCD, organised as an image or a mere list of points."""

import os
import tokenize
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput

MAX_SIDE = 4096
MAX_POINTS = MAX_SIDE * MAX_SIDE
MAX_CLOUD_BYTES = 420_000_000  # a cloud of 4096 × 4096 points of three float64 numbers, and its header
MAX_HEADER_BYTES = 65_536
LETTERS = {"float": "f4", "double": "f8", "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}


class Cloud(NamedTuple):
    """`points` (H, W, 3) if organised as an image's rows, else (n, 3), in the file's own unit and frame, NaN where no reading.

    `T_cloud_sensor` (4, 4) is where the file says that its sensor stood, in the file's unit, None if it does not say.
    """

    points: NDArray
    T_cloud_sensor: NDArray | None = None

    @property
    def organised(self) -> bool:
        return self.points.ndim == 3


def check_points(path: Path, width: int, height: int = 1) -> None:
    """Raises BadInput unless width × height points are a possible cloud."""
    if height > 1 and not (1 <= width <= MAX_SIDE and height <= MAX_SIDE):
        raise BadInput(f'cloud "{path}" is {width} × {height} px, the limit is {MAX_SIDE} × {MAX_SIDE}.')
    if not 0 <= width * height <= MAX_POINTS:
        raise BadInput(f'cloud "{path}" has {width * height} points, the limit is {MAX_POINTS}.')


def broken(path: os.PathLike, what: str) -> BadInput:
    """'cloud "a.ply" cannot be read: …'"""
    return BadInput(f'cloud "{path}" cannot be read: {what}.')


def header_lines(path: Path, last: Callable[[str], bool]) -> tuple[list[str], int]:
    """The lines of a text header up to the one that `last` tells, and where the data begin [bytes]. Raises BadInput."""
    with path.open("rb") as file:
        content = file.read(MAX_HEADER_BYTES)
    lines, start = [], 0
    while (end := content.find(b"\n", start)) >= 0:
        lines.append(content[start:end].decode("latin-1").strip())
        start = end + 1
        if last(lines[-1]):
            return lines, start
    raise broken(path, f"its header does not end within {MAX_HEADER_BYTES} bytes")


def text_columns(path: Path, start: int, skip: int, rows: int, columns: list[int]) -> NDArray:
    """Numbers (rows, len(columns)) of lines of text from byte `start` on, after `skip` lines. Raises BadInput."""
    with path.open("rb") as file:
        file.seek(start)
        for _ in range(skip):
            file.readline()
        if rows == 0:
            return np.empty((0, len(columns)))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # of no data: told below
                numbers = np.loadtxt(file, usecols=columns, max_rows=rows, comments=None, ndmin=2, encoding="latin-1")
        except (ValueError, IndexError, OverflowError) as error:
            raise broken(path, str(error).splitlines()[0][:120]) from None
    if len(numbers) < rows:
        raise broken(path, f"it ends after {len(numbers)} of {rows} points")
    return numbers


def binary_records(path: Path, start: int, rows: int, record: np.dtype) -> NDArray:
    """Records (rows,) from byte `start` on, not yet read into memory. Raises BadInput."""
    have = path.stat().st_size - start
    if have < rows * record.itemsize:
        raise broken(path, f"it ends after {max(have, 0) // max(record.itemsize, 1)} of {rows} points")
    return np.memmap(path, dtype=record, mode="r", offset=start, shape=(rows,)) if rows else np.empty(0, record)


def stacked(x: NDArray, y: NDArray, z: NDArray) -> NDArray:
    """Points (n, 3) of three columns, as float32 if that holds them all, else float64; what is not finite becomes NaN."""
    exact = all(column.dtype.kind == "f" and column.dtype.itemsize <= 4 for column in (x, y, z))
    points = np.empty((len(x), 3), np.float32 if exact else np.float64)
    for k, column in enumerate((x, y, z)):
        points[:, k] = column
    points[~np.isfinite(points).all(axis=1)] = np.nan
    return points


def read_npy(path: Path) -> Cloud:
    """An array (H, W, 3) or (n, 3) of floating-point numbers. Raises BadInput."""
    try:
        array = np.load(path, allow_pickle=False, mmap_mode="r")
    except (OSError, ValueError, EOFError, SyntaxError, TypeError, OverflowError, MemoryError, tokenize.TokenError) as error:
        told = (str(error) or "it is damaged").splitlines()[0][:120].rstrip(".")
        raise BadInput(f'organised cloud "{path}" cannot be read as an array: {told}.') from None
    if not isinstance(array, np.ndarray) or array.ndim not in (2, 3) or array.shape[-1] != 3 or array.dtype.kind != "f":
        shape = getattr(array, "shape", "unknown")
        raise BadInput(f'organised cloud "{path}" has shape {shape}; it must be (H, W, 3) or (n, 3) floating-point numbers.')
    check_points(path, array.shape[-2], array.shape[0] if array.ndim == 3 else 1)
    flat = array.reshape(-1, 3)
    return Cloud(stacked(flat[:, 0], flat[:, 1], flat[:, 2]).reshape(array.shape))
