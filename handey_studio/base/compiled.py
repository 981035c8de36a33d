"""What compiled code shares."""

from pathlib import Path
from typing import Any

from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def put(values: NDArray, out: NDArray) -> None:
    """Writes values (n,) into out (n,) one by one: an assignment to the slice compiles the wording of its errors too, for seconds."""
    for k in range(len(out)):
        out[k] = values[k]


def is_compiled(function: Any) -> bool:
    """Whether this machine keeps the machine code of a compiled function as its source is now."""
    source = Path(function.py_func.__code__.co_filename)
    kept = Path(function.stats.cache_path).glob(f"{source.stem}.{function.__name__}-*.nbi")
    return any(file.stat().st_mtime >= source.stat().st_mtime for file in kept)
