"""What compiled code shares."""

from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def put(values: NDArray, out: NDArray) -> None:
    """Writes values (n,) into out (n,) one by one: an assignment to the slice compiles the wording of its errors too, for seconds."""
    for k in range(len(out)):
        out[k] = values[k]
